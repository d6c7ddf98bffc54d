//! Nothing to choose, nothing to reach, too few iterations, data that are no problem.

use super::*;
use crate::lti::FirMatrix;
use hybank_linalg::LinalgError;

#[test]
fn problems_without_a_choice_are_right() {
    let problem = random_problem(5, (2, 2, 3), 9, &[0, 0]);
    let s = solve("no taps", &problem);
    assert!(s.is_solved && s.taps == problem.zero_taps() && relative_gap(&s) < 1e-12);
    let deaf = changed(&random_problem(5, (2, 2, 3), 9, &[2, 2]), |_, p| p.h.fill(Complex::default()));
    let s = solve("H = 0", &deaf);
    assert!(s.is_solved && relative_gap(&s) < 1e-12 && s.gamma == deaf.worst(&deaf.zero_taps()).unwrap());
    let nothing = changed(&random_problem(5, (2, 2, 3), 9, &[2, 2]), |_, p| p.w.fill(Complex::default()));
    let s = solve("W = 0", &nothing);
    assert!(s.is_solved && s.gamma == 0.0 && s.taps.lags().iter().all(|f| f.norm() == 0.0));
}

/// W in the row space of H by known taps: found again, whatever their size.
#[test]
fn exactly_reproducible_targets_give_zero() {
    for (seed, sizes) in [(1, (2, 2, 4)), (2, (3, 2, 3)), (3, (1, 3, 3))] {
        let problem = random_problem(seed, sizes, 30, &vec![4; sizes.0]);
        let mut r = Random(99 + seed);
        let taps: FirMatrix =
            (0..4).map(|_| hybank_linalg::Mat::from_fn(sizes.0, sizes.1, |_, _| r.sample())).collect();
        let zero = changed(&problem, |_, p| p.w.fill(Complex::default()));
        let reachable = changed(&problem, |l, p| p.w = -zero.error_at(l, &taps));
        let s = solve("reachable", &reachable);
        assert!(s.is_solved && s.gamma < 1e-12);
        for (a, b) in s.taps.lags().iter().zip(taps.lags()) {
            assert!((a - b).norm() < 1e-10);
        }
    }
}

/// However often it is asked before its end is due, the iteration ends without another whole step, and
/// keeps the best taps so far.
#[test]
fn an_iteration_whose_end_is_due_ends_at_once_with_its_best_taps() {
    let problem = random_problem(31, (2, 2, 4), 30, &[5, 5]);
    let full = minimise(&problem, FINEST_GAP, &|| false).unwrap();
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
        let s = minimise(&problem, FINEST_GAP, &is_due).unwrap();
        check(&problem, &s);
        assert!(!s.is_solved);
        assert!(asked.get() <= before + 12, "{} {before}", asked.get());
        assert!(s.gamma >= full.lower && s.lower <= full.gamma);
        last = s.gamma;
        first = first.min(if before == 0 { s.gamma } else { first });
        asked.set(0);
        let ms =
            mean_square_under_cap(&problem, &square, cap, &full.taps, FINEST_GAP, &is_due).unwrap().unwrap();
        assert!(asked.get() <= before + 12, "{} {before}", asked.get());
        assert!(ms.mean_square <= of_start && ms.gamma <= cap && ms.lower <= ms.mean_square, "{ms:?}");
    }
    assert!(last < first, "{last} {first}");
}

#[test]
fn what_is_not_finite_is_refused_and_a_cap_below_the_start_has_no_taps() {
    let good = random_problem(1, (2, 2, 3), 3, &[2, 2]);
    let bad = Complex::new(0.0, f64::INFINITY);
    let refused = |change: &dyn Fn(&mut FrequencyPoint)| {
        minimise(
            &changed(&good, |l, p| {
                if l == 1 {
                    change(p)
                }
            }),
            FINEST_GAP,
            &|| false,
        )
    };
    assert!(matches!(refused(&|p| p.omega = f64::NAN), Err(LinalgError::NotFinite { .. })));
    assert!(matches!(refused(&|p| p.h[(1, 1)] = bad), Err(LinalgError::NotFinite { .. })));
    assert!(matches!(refused(&|p| p.w[(1, 1)] = bad), Err(LinalgError::NotFinite { .. })));
    let s = minimise(&good, FINEST_GAP, &|| false).unwrap();
    let square = MeanSquareObjective::noiseless(vec![1.0; 3], good.channels());
    let capped = mean_square_under_cap(&good, &square, 0.5 * s.gamma, &s.taps, FINEST_GAP, &|| false);
    assert!(capped.unwrap().is_none());
}

#[test]
#[should_panic = "one size"]
fn points_of_different_sizes_are_a_fault_of_the_caller() {
    changed(&random_problem(1, (2, 2, 3), 3, &[2, 2]), |l, p| p.h = CMat::zeros(2, 3 + l));
}
