//! Nothing to choose, nothing to reach, too few iterations, data that are no problem.

use super::*;

#[test]
fn problems_without_a_choice_are_right() {
    let problem = random_problem(5, (2, 2, 3), 9, &[0, 0]);
    let s = solve("no taps", &problem);
    assert!(s.outcome == Outcome::Solved && s.taps.is_empty() && relative_gap(&s) < 1e-12);
    let deaf = changed(&random_problem(5, (2, 2, 3), 9, &[2, 2]), |_, p| p.h.fill(Complex::default()));
    let s = solve("H = 0", &deaf);
    assert!(
        s.outcome == Outcome::Solved
            && relative_gap(&s) < 1e-12
            && s.gamma == deaf.worst(&deaf.zero_taps()).unwrap().0
    );
    let nothing = changed(&random_problem(5, (2, 2, 3), 9, &[2, 2]), |_, p| p.w.fill(Complex::default()));
    let s = solve("W = 0", &nothing);
    assert!(s.outcome == Outcome::Solved && s.gamma == 0.0 && s.taps.iter().all(|f| f.norm() == 0.0));
}

/// W in the row space of H by known taps: found again, whatever their size.
#[test]
fn exactly_reproducible_targets_give_zero() {
    for (seed, sizes) in [(1, (2, 2, 4)), (2, (3, 2, 3)), (3, (1, 3, 3))] {
        let problem = random_problem(seed, sizes, 30, &vec![4; sizes.0]);
        let mut r = Random(99 + seed);
        let taps: Taps =
            (0..4).map(|_| crate::linalg::Mat::from_fn(sizes.0, sizes.1, |_, _| r.sample())).collect();
        let zero = changed(&problem, |_, p| p.w.fill(Complex::default()));
        let reachable = changed(&problem, |l, p| p.w = -zero.error_at(l, &taps));
        let s = solve("reachable", &reachable);
        assert!(s.outcome == Outcome::Solved && s.gamma < 1e-12);
        for (a, b) in s.taps.iter().zip(&taps) {
            assert!((a - b).norm() < 1e-10);
        }
    }
}

#[test]
fn an_exhausted_iteration_limit_keeps_valid_bounds() {
    let problem = random_problem(31, (2, 2, 4), 30, &[5, 5]);
    let full = minimise(&problem, &Settings::DEFAULT, &|| false).unwrap();
    for max_iterations in 0..6 {
        let s = minimise(&problem, &Settings { max_iterations, ..Settings::DEFAULT }, &|| false).unwrap();
        check(&problem, &s);
        assert_eq!(s.outcome, Outcome::IterationLimit);
        assert_eq!(s.iterations, max_iterations);
        assert!(s.gamma >= full.lower.value && s.lower.value <= full.gamma && s.lower.value > 0.0);
    }
}

/// However often it is asked before its end is due, the iteration ends without another whole step, and keeps the
/// best taps so far.
#[test]
fn an_iteration_whose_end_is_due_ends_at_once_with_its_best_taps() {
    let problem = random_problem(31, (2, 2, 4), 30, &[5, 5]);
    let full = minimise(&problem, &Settings::DEFAULT, &|| false).unwrap();
    let square = MeanSquareObjective::noiseless(vec![1.0; 30], problem.channels());
    let cap = full.gamma * 1.01;
    let of_start = problem.mean_square(&full.taps, &square);
    let points = 30;
    let (mut first, mut last) = (f64::INFINITY, f64::INFINITY);
    for before in [0, 1, 7, points, 5 * points, 20 * points, 60 * points] {
        let asked = std::cell::Cell::new(0);
        let is_due = || {
            asked.set(asked.get() + 1);
            asked.get() > before
        };
        let s = minimise(&problem, &Settings::DEFAULT, &is_due).unwrap();
        check(&problem, &s);
        assert_eq!(s.outcome, Outcome::IterationLimit);
        assert!(asked.get() <= before + 12, "{} {before}", asked.get());
        assert!(s.gamma >= full.lower.value && s.lower.value <= full.gamma);
        last = s.gamma;
        first = first.min(if before == 0 { s.gamma } else { first });
        asked.set(0);
        let ms =
            mean_square_under_cap(&problem, &square, cap, &full.taps, &Settings::DEFAULT, &is_due).unwrap();
        assert!(asked.get() <= before + 12, "{} {before}", asked.get());
        assert!(ms.mean_square <= of_start && ms.gamma <= cap && ms.lower <= ms.mean_square, "{ms:?}");
    }
    assert!(last < first, "{last} {first}");
}

#[test]
fn what_is_no_problem_is_refused() {
    let good = random_problem(1, (2, 2, 3), 3, &[2, 2]);
    let with = |change: &dyn Fn(&mut Vec<Point>)| {
        let mut points = good.points().to_vec();
        change(&mut points);
        Problem::new(points, vec![2, 2]).unwrap_err()
    };
    assert!(matches!(with(&|p| p.clear()), LmiError::Empty { points: 0, .. }));
    let size = |name: &str, given, wanted| LmiError::Size { name: name.into(), given, wanted };
    assert_eq!(with(&|p| p[2].h = CMat::zeros(2, 4)), size("H of point 2", (2, 4), (2, 3)));
    assert_eq!(with(&|p| p[1].w = CMat::zeros(3, 3)), size("W of point 1", (3, 3), (2, 3)));
    let not_finite = |name: &str| LmiError::NotFinite { name: name.into() };
    assert_eq!(with(&|p| p[1].omega = f64::NAN), not_finite("omega of point 1"));
    let bad = Complex::new(0.0, f64::INFINITY);
    assert_eq!(with(&|p| p[0].h[(1, 1)] = bad), not_finite("H of point 0"));
    assert!(matches!(
        Problem::new(good.points().to_vec(), vec![1]),
        Err(LmiError::Count { given: 1, wanted: 2, .. })
    ));
    let s = minimise(&good, &Settings::DEFAULT, &|| false).unwrap();
    let channels = good.channels();
    let with = |weights: &[f64], noise: &[f64]| MeanSquareObjective {
        weights: weights.to_vec(),
        noise: noise.to_vec(),
    };
    let capped = |square: &MeanSquareObjective, cap, taps| {
        mean_square_under_cap(&good, square, cap, taps, &Settings::DEFAULT, &|| false)
    };
    let ones = MeanSquareObjective::noiseless(vec![1.0; 3], channels);
    let refused = |weights: &[f64], noise: &[f64]| capped(&with(weights, noise), 1.0, &s.taps).unwrap_err();
    assert!(matches!(refused(&[1.0; 2], &ones.noise), LmiError::Count { given: 2, wanted: 3, .. }));
    assert!(matches!(
        refused(&[1.0, -1.0, 1.0], &ones.noise),
        LmiError::Weight { name: "weight", index: 1, .. }
    ));
    assert!(matches!(refused(&[1.0; 3], &[]), LmiError::Count { name: "noise powers", given: 0, .. }));
    let negative = vec![-1.0; channels];
    assert!(matches!(refused(&[1.0; 3], &negative), LmiError::Weight { name: "noise power", index: 0, .. }));
    assert!(matches!(capped(&ones, 0.5 * s.gamma, &s.taps), Err(LmiError::Cap { .. })));
    let small = vec![crate::linalg::Mat::zeros(1, 1)];
    assert!(matches!(capped(&ones, 1.0, &small), Err(LmiError::Size { .. })));
    let beyond = LmiError::TapBeyondLags { row: 1, lag: 2, lags: 2 };
    let late = |j: usize| crate::linalg::Mat::from_fn(2, 2, |p, _| f64::from(u8::from(j == 2 && p == 1)));
    let late: Taps = (0..3).map(late).collect();
    assert_eq!(capped(&ones, 1.0, &late).unwrap_err(), beyond);
    assert!(matches!(lower_bound(&good, &[], 1.0), Err(LmiError::Count { .. })));
}
