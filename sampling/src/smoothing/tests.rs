//! Smoothing splines against closed forms, and against the conditional distribution of the walk itself.

use super::*;
use crate::random::Random;

fn sample(x: f64, value: f64, error: f64) -> Measured {
    Measured { x, value, error, jitter: 0.0 }
}

/// A normal number by the sum of twelve uniform ones.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.part()).sum::<f64>() - 6.0
}

/// A x = b by elimination with pivots, for a small matrix.
fn solved(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap();
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            (k..n).for_each(|j| a[i][j] -= factor * a[k][j]);
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        b[k] = (b[k] - (k + 1..n).map(|j| a[k][j] * b[j]).sum::<f64>()) / a[k][k];
    }
    b
}

/// Value and variance by kriging with an unknown line: cov(f(x), f(y)) = q (m^2 M / 2 - m^3 / 6) with m the
/// smaller and M the larger of x and y.
fn kriged(samples: &[Measured], q: f64, x: f64) -> (f64, f64) {
    let covariance = |x: f64, y: f64| {
        let (m, large) = (x.min(y), x.max(y));
        q * (m * m * large / 2.0 - m.powi(3) / 6.0)
    };
    let n = samples.len();
    let mut a = vec![vec![0.0; n + 2]; n + 2];
    let mut b = vec![0.0; n + 2];
    for (i, s) in samples.iter().enumerate() {
        for (j, t) in samples.iter().enumerate() {
            a[i][j] = covariance(s.x, t.x) + if i == j { s.error * s.error } else { 0.0 };
        }
        (a[i][n], a[n][i], a[i][n + 1], a[n + 1][i]) = (1.0, 1.0, s.x, s.x);
        b[i] = covariance(s.x, x);
    }
    (b[n], b[n + 1]) = (1.0, x);
    let weights = solved(a, b.clone());
    let value = (0..n).map(|i| weights[i] * samples[i].value).sum();
    (value, covariance(x, x) - weights.iter().zip(&b).map(|(w, b)| w * b).sum::<f64>())
}

/// Irregular samples of errors that differ by up to ten, with a gap: between them, at them and beyond them.
#[test]
fn the_spline_is_the_conditional_mean_of_the_walk() {
    let mut random = Random(3);
    for q in [0.003, 0.1, 3.0] {
        let mut x = 0.5;
        let samples: Vec<Measured> = (0..24)
            .map(|k| {
                x += 0.2 + random.part() + if k == 12 { 8.0 } else { 0.0 };
                let error = 0.3 * 10.0_f64.powf(-random.part());
                sample(x, 4.0 + 0.7 * x + (0.5 * x).sin() + error * normal(&mut random), error)
            })
            .collect();
        let spline = SmoothingSpline::new(samples.clone(), q).unwrap();
        let (first, last) = (samples[0].x, x);
        for k in -4..=40 {
            let x = first + (last - first) * f64::from(k) / 36.0;
            let (value, variance) = kriged(&samples, q, x.max(0.0));
            let found = spline.at(x.max(0.0));
            assert_eq!(spline.value(x.max(0.0)), found.value);
            assert!((found.variance / variance - 1.0).abs() < 0.03, "{q} {x}: {found:?} {variance}");
            assert!((found.value - value).abs() < 0.03 * variance.sqrt(), "{q} {x}: {found:?} {value}");
        }
    }
}

/// A beam on two supports under a load at a and b from them bends by a^2 b^2 / (3 T) there.
#[test]
fn between_two_exact_samples_the_variance_is_that_of_a_beam() {
    let spline = SmoothingSpline::new(vec![sample(2.0, 1.0, 0.0), sample(12.0, 6.0, 0.0)], 0.25).unwrap();
    for a in [0.0, 1.0, 3.7, 5.0, 9.0] {
        let (b, found) = (10.0 - a, spline.at(2.0 + a));
        let want = 0.25 * a * a * b * b / 30.0;
        assert!((found.value - (1.0 + 0.5 * a)).abs() < 1e-6, "{found:?}");
        assert!((found.variance - want).abs() < 0.02 * want + 1e-4, "{a}: {found:?} {want}");
    }
}

/// sigma^2 D / (2 sqrt(2) l), from the spectrum 1 / (1 + (l w)^4) of the kernel.
#[test]
fn dense_samples_have_the_variance_of_the_equivalent_kernel() {
    let (sigma, distance, q) = (0.2, 0.05, 1e-4);
    let samples: Vec<Measured> = (0..2000).map(|k| sample(distance * f64::from(k), 3.0, sigma)).collect();
    let found = SmoothingSpline::new(samples, q).unwrap().at(50.0);
    let length = (sigma * sigma * distance / q).powf(0.25);
    let want = sigma * sigma * distance / (8.0_f64.sqrt() * length);
    assert!((found.variance / want - 1.0).abs() < 0.01, "{} {want}", found.variance);
    assert!((found.value - 3.0).abs() < 1e-9 && found.slope.abs() < 1e-9);
}

#[test]
fn lines_and_constants_are_reproduced() {
    let samples = [0.0, 0.4, 3.0, 3.1, 9.0, 30.0].map(|x| sample(x, 5.0 - 2.0 * x, 0.3)).to_vec();
    let spline = SmoothingSpline::new(samples, 1e-3).unwrap();
    for x in [-3.0, 0.2, 6.0, 20.0, 45.0] {
        let found = spline.at(x);
        assert!(
            (found.value - (5.0 - 2.0 * x)).abs() < 1e-7 && (found.slope + 2.0).abs() < 1e-7,
            "{found:?}"
        );
    }
}

#[test]
fn a_sample_that_contradicts_the_others_shows() {
    let mut random = Random(8);
    let mut samples: Vec<Measured> =
        (0..60).map(|k| sample(f64::from(k), 0.1 * f64::from(k) + 0.2 * normal(&mut random), 0.2)).collect();
    let worst = |samples: &[Measured]| {
        let spline = SmoothingSpline::new(samples.to_vec(), 1e-6).unwrap();
        let found: Vec<f64> = spline.left_out().map(|out| out.miss / out.deviation).collect();
        let worst = (0..60).max_by(|a, b| found[*a].total_cmp(&found[*b])).unwrap();
        let mean_square = found.iter().map(|c| c * c).sum::<f64>() / 60.0;
        (worst, found[worst], mean_square)
    };
    let (_, largest, mean_square) = worst(&samples);
    assert!(largest < 4.0 && (0.6..1.5).contains(&mean_square), "{largest} {mean_square}");
    samples[23].value += 1.6;
    let (place, largest, _) = worst(&samples);
    assert!(place == 23 && (6.0..11.0).contains(&largest), "{place} {largest}");
}

#[test]
fn what_determines_no_spline_is_refused() {
    let refused = |samples: Vec<Measured>, walk| SmoothingSpline::new(samples, walk).unwrap_err();
    let two = vec![sample(0.0, 1.0, 0.1), sample(1.0, 1.0, 0.1)];
    assert!(matches!(refused(two[..1].to_vec(), 1.0), SamplingError::Setting { .. }));
    assert!(matches!(refused(vec![two[0]; 3], 1.0), SamplingError::Setting { .. }));
    assert!(matches!(refused(two.clone(), -1.0), SamplingError::Setting { .. }));
    assert!(matches!(refused(two.clone(), f64::NAN), SamplingError::Setting { .. }));
    let nan = vec![two[0], sample(2.0, f64::NAN, 0.1)];
    assert!(matches!(refused(nan, 1.0), SamplingError::NotFinite { name: "sample value", index: 1, .. }));
    let exact = vec![sample(0.0, 1.0, 0.0), sample(1.0, 1.0, 0.0)];
    assert!(matches!(refused(exact, 0.0), SamplingError::Setting { .. }));
    // A slope that does not walk is a line.
    let line = SmoothingSpline::new(vec![two[0], two[1], sample(2.0, 4.0, 0.1)], 0.0).unwrap();
    assert!((line.at(1.0).slope - 1.5).abs() < 1e-3, "{:?}", line.at(1.0));
}
