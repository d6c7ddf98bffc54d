//! The secondary objective.

use super::*;

/// gamma = 1.02 gamma* leaves room; at a cap of gamma* (1 + 1e-6) there is next to none.
#[test]
fn mean_square_under_a_cap_is_never_worse_than_the_start() {
    for (seed, (sizes, points, lags)) in SHAPES.into_iter().enumerate() {
        let problem = random_problem(seed as u64, sizes, points, lags);
        let s = minimise(&problem, FINEST_GAP, &|| false).unwrap();
        let square = MeanSquareObjective::noiseless(vec![1.0; points], problem.channels());
        let mut last = problem.mean_square(&s.taps, &square) * (1.0 + 1e-12);
        for slack in [1e-6, 1e-3, 1e-1, 10.0] {
            let cap = s.gamma * (1.0 + slack);
            let ms = mean_square_under_cap(&problem, &square, cap, &s.taps, FINEST_GAP, &|| false)
                .unwrap()
                .unwrap();
            println!("{sizes:?} slack {slack}: {} {} {}", ms.mean_square, ms.lower, ms.iterations);
            assert!(ms.gamma <= cap && ms.mean_square <= last * (1.0 + 1e-7));
            assert!(ms.lower >= ms.mean_square * (1.0 - 1e-5), "{ms:?}");
            last = ms.mean_square;
        }
        let free = least_squares(&problem, &square, 1e-12).unwrap();
        assert!((problem.mean_square(&free, &square) - last).abs() <= 1e-9 * last);
    }
}

/// Noise by another route: a full circle of points with nothing wanted and the noise as input, so weak that
/// the cap does not see it and so heavy that the mean square does.
#[test]
fn noise_of_the_channels_is_like_points_of_its_own() {
    let (m, n, q, lags) = (2, 2, 5, [3, 2]);
    let problem = random_problem(11, (m, n, q), 9, &lags);
    let s = minimise(&problem, FINEST_GAP, &|| false).unwrap();
    for noise in [[0.3, 2.0], [0.0, 1.0], [1e-6, 1e3]] {
        let square = MeanSquareObjective { weights: vec![1.0; 9], noise: noise.to_vec() };
        let (circle, faint) = (8, 1e-4);
        let points = (0..circle).map(|l| {
            let mut h = CMat::zeros(n, q);
            (0..n).for_each(|i| h[(i, i)] = Complex::from(faint * noise[i].sqrt()));
            FrequencyPoint {
                omega: std::f64::consts::TAU * l as f64 / circle as f64,
                w: CMat::zeros(m, q),
                h,
            }
        });
        let mut weights = vec![1.0; 9];
        weights.extend(vec![1.0 / (faint * faint * circle as f64); circle]);
        let longer = problem.with_points(points);
        let alike = MeanSquareObjective::noiseless(weights, n);
        let value = problem.mean_square(&s.taps, &square);
        assert!((longer.mean_square(&s.taps, &alike) - value).abs() < 1e-9 * value);
        let free = problem.mean_square(&least_squares(&problem, &square, 1e-12).unwrap(), &square);
        let other = longer.mean_square(&least_squares(&longer, &alike, 1e-12).unwrap(), &alike);
        assert!((free - other).abs() < 1e-9 * free, "{noise:?}: {free} {other}");
        for slack in [1e-3, 0.05, 0.5] {
            let cap = (1.0 + slack) * s.gamma;
            let capped = |p: &SampledProblem, q: &MeanSquareObjective| {
                mean_square_under_cap(p, q, cap, &s.taps, FINEST_GAP, &|| false).unwrap().unwrap()
            };
            let (a, b) = (capped(&problem, &square), capped(&longer, &alike));
            assert!(a.gamma <= cap && a.lower >= a.mean_square * (1.0 - 1e-6), "{a:?}");
            let apart = (a.mean_square - b.mean_square).abs();
            assert!(
                apart < 1e-6 * a.mean_square,
                "{noise:?} slack {slack}: {} {}",
                a.mean_square,
                b.mean_square
            );
        }
    }
}
