//! The banded fit against dense normal equations, and its edges.

use super::*;
use proptest::prelude::*;

struct Sample {
    x: f64,
    f: [f64; 2],
    w: f64,
    mu: f64,
}

/// Dense normal equations from the definition, Gaussian elimination with pivoting.
fn dense<const ORDER: usize>(
    range: std::ops::Range<i64>,
    samples: &[Sample],
    tau: f64,
    ridge: f64,
) -> Vec<[f64; 2]> {
    let n = (range.end - range.start) as usize;
    let mut a = vec![vec![0.0; n + 2]; n];
    for s in samples {
        let (k0, w, d) = BSpline::<ORDER>::weights_and_slopes(s.x);
        for i in 0..ORDER {
            let row = (k0 + i as i64 - range.start) as usize;
            for j in 0..ORDER {
                let col = (k0 + j as i64 - range.start) as usize;
                a[row][col] += s.w * (w[i] * w[j] + s.mu * d[i] * d[j]);
            }
            for c in 0..2 {
                a[row][n + c] += s.w * w[i] * s.f[c];
            }
        }
    }
    for m in 0..n {
        a[m][m] += ridge;
        if m + 1 < n {
            a[m][m] += tau;
            a[m + 1][m + 1] += tau;
            a[m][m + 1] -= tau;
            a[m + 1][m] -= tau;
        }
    }
    for col in 0..n {
        let pivot = (col..n).max_by(|i, j| a[*i][col].abs().total_cmp(&a[*j][col].abs())).unwrap();
        a.swap(col, pivot);
        let top = a[col].clone();
        for (r, row) in a.iter_mut().enumerate() {
            if r != col {
                let factor = row[col] / top[col];
                row.iter_mut().zip(&top).for_each(|(x, t)| *x -= factor * t);
            }
        }
    }
    (0..n).map(|m| [a[m][n] / a[m][m], a[m][n + 1] / a[m][m]]).collect()
}

fn check_dense<const ORDER: usize>(samples: &[Sample], tau: f64, ridge: f64) {
    let mut fit = Fit::<ORDER, 2>::covering(12);
    for s in samples {
        assert!(fit.add(s.x, &s.f, s.w, s.mu));
    }
    fit.regularise(tau, ridge);
    fit.solve().unwrap();
    let exact = dense::<ORDER>(fit.range(), samples, tau, ridge);
    for (got, want) in fit.coefficients().iter().zip(&exact) {
        for c in 0..2 {
            assert!((got[c] - want[c]).abs() < 1e-9 * (1.0 + want[c].abs()), "{got:?} {want:?}");
        }
    }
}

#[test]
fn a_spline_in_the_space_is_recovered() {
    let truth = |x: f64| {
        (-3..16).map(move |m: i64| {
            let c = ((m * m * 7 + 3) % 11) as f64;
            let (k, w) = BSpline::<4>::weights(x);
            usize::try_from(m - k).ok().and_then(|j| w.get(j)).map_or(0.0, |w| c * w)
        })
    };
    let mut fit = Fit::<4, 1>::covering(12);
    for step in 0..=120 {
        let x = step as f64 * 0.1;
        assert!(fit.add(x, &[truth(x).sum()], 1.0, 0.0));
    }
    fit.regularise(0.0, 1e-12);
    fit.solve().unwrap();
    for step in 0..120 {
        let x = step as f64 * 0.1 + 0.05;
        let exact: f64 = truth(x).sum();
        assert!((fit.value(x)[0] - exact).abs() < 1e-8, "{x}");
    }
}

#[test]
fn slopes_are_the_derivative_of_the_values() {
    let mut fit = Fit::<4, 1>::covering(8);
    for step in 0..=16 {
        fit.add(step as f64 * 0.5, &[(step as f64).sin()], 1.0, 0.01);
    }
    fit.regularise(0.01, 0.0);
    fit.solve().unwrap();
    for x in [0.3, 2.0, 5.5, 7.9] {
        let numeric = (fit.value(x + 1e-6)[0] - fit.value(x - 1e-6)[0]) / 2e-6;
        assert!((fit.slope(x)[0] - numeric).abs() < 1e-8);
    }
    let knots: Vec<f64> = fit.knot_values(0).take(9).map(|v| v[0]).collect();
    assert_eq!(knots.len(), 9);
    assert!(knots.iter().enumerate().all(|(j, v)| (v - fit.value(j as f64)[0]).abs() < 1e-14));
}

#[test]
fn intervals_without_samples_are_bridged_by_a_straight_line() {
    let mut fit = Fit::<2, 1>::covering(20);
    fit.add(0.0, &[0.0], 1e9, 0.0);
    fit.add(20.0, &[10.0], 1e9, 0.0);
    fit.regularise(0.05, 0.0);
    fit.solve().unwrap();
    for x in 0..=20 {
        assert!((fit.value(x as f64)[0] - 0.5 * x as f64).abs() < 1e-6);
    }
}

#[test]
fn batches_have_the_bits_of_single_samples() {
    for count in [0, 1, 7, 8, 9, 40] {
        let position = |i: usize| if i % 11 == 5 { f64::NAN } else { (i * 7 % 40) as f64 * 0.37 - 1.9 };
        let samples: Vec<FitSample<2>> = (0..count)
            .map(|i| FitSample { x: position(i), values: [i as f64, 3.0], weight: 0.7, slope_weight: 0.2 })
            .collect();
        let (mut single, mut together) = (Fit::<4, 2>::covering(9), Fit::<4, 2>::covering(9));
        let added = samples.iter().filter(|s| single.add(s.x, &s.values, s.weight, s.slope_weight)).count();
        assert_eq!(together.add_all(samples.iter().copied()), added);
        assert_eq!((together.band, together.rhs), (single.band, single.rhs));
    }
}

#[test]
fn a_coefficient_without_samples_is_an_error() {
    let mut fit = Fit::<4, 1>::covering(9);
    fit.add(4.2, &[1.0], 1.0, 0.1);
    assert!(matches!(fit.solve(), Err(SamplingError::NotDefinite { column: 0, .. })));
    fit.clear();
    assert_eq!(fit.solve(), Err(SamplingError::NotDefinite { column: 0, pivot: 0.0 }));
}

#[test]
fn samples_outside_are_refused_and_change_nothing() {
    let mut fit = Fit::<4, 1>::covering(9);
    let empty = fit.clone();
    for x in [-2.1, 11.1, 1e9, -1e9, 1e300, f64::NAN, f64::INFINITY] {
        assert!(!fit.add(x, &[1.0], 1.0, 0.0), "{x}");
    }
    assert_eq!(fit.band, empty.band);
    assert_eq!(fit.rhs, empty.rhs);
}

#[test]
fn a_used_workspace_gives_the_bits_of_a_fresh_one() {
    let run = |fit: &mut Fit<4, 1>| {
        for step in 0..30 {
            fit.add(step as f64 * 0.31, &[(step as f64 * 1.7).cos()], 1.0, 0.1);
        }
        fit.regularise(0.05, 1e-9);
        fit.solve().unwrap();
        fit.coefficients().to_vec()
    };
    let mut fit = Fit::<4, 1>::covering(10);
    let again = run(&mut fit);
    fit.reset(-7, 40);
    fit.add(3.0, &[1e9], 1e9, 1e9);
    fit.reset(-3, 17);
    assert_eq!(run(&mut fit), again);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn banded_equals_dense(
        raw in prop::collection::vec((0.0..12.0_f64, -255.0..255.0_f64, -1e3..1e3_f64, 0.01..2.0_f64, 0.0..1.0_f64), 1..40),
        tau in 1e-3..1.0_f64
    ) {
        let samples: Vec<Sample> =
            raw.iter().map(|r| Sample { x: r.0, f: [r.1, r.2], w: r.3, mu: r.4 }).collect();
        check_dense::<2>(&samples, tau, 1e-6);
        check_dense::<4>(&samples, tau, 1e-6);
    }
}
