//! Shapes, units, copies of channels: the optimum does not depend on them.

use super::*;

#[test]
fn every_shape_is_solved_to_a_proven_gap() {
    for (seed, (sizes, points, lags)) in SHAPES.into_iter().enumerate() {
        let problem = random_problem(seed as u64, sizes, points, lags);
        let s = solve(&format!("{sizes:?} {points} {lags:?}"), &problem);
        assert!(s.is_solved);
        assert!(relative_gap(&s) <= 1e-9);
    }
}

/// Units of the wanted signal, of single channels, and orthogonal changes of inputs leave the relative
/// optimum alone.
#[test]
fn units_do_not_matter() {
    let problem = random_problem(7, (2, 3, 4), 25, &[4, 3]);
    let gamma = solve("plain", &problem).gamma;
    for scale in [1e-9, 1e9] {
        let wanted = changed(&problem, |_, p| p.w *= Complex::new(scale, 0.0));
        let s = solve("wanted scaled", &wanted);
        assert!(s.is_solved && (s.gamma / scale - gamma).abs() < 2e-9 * gamma);
        let channel = changed(&problem, |_, p| p.h.row_mut(1).iter_mut().for_each(|z| *z *= scale));
        let s = solve("channel scaled", &channel);
        assert!(s.is_solved && (s.gamma - gamma).abs() < 2e-9 * gamma);
    }
    let mut r = Random(3);
    let turn = hybank_linalg::svd(&random_matrix(&mut r, 4, 4)).unwrap().u;
    let turned = changed(&problem, |_, p| (p.w, p.h) = (&p.w * &turn, &p.h * &turn));
    assert!((solve("turned", &turned).gamma - gamma).abs() < 2e-9 * gamma);
}

/// Two equal channels are one: same optimum, and the taps share the work instead of blowing up.
#[test]
fn equal_channels_count_once() {
    let single = random_problem(11, (2, 1, 3), 25, &[4, 4]);
    let gamma = solve("single", &single).gamma;
    for factor in [1.0, -3.0, 1e-6] {
        let double = changed(&single, |_, p| {
            let h = p.h.clone();
            p.h = CMat::from_fn(2, 3, |i, j| h[(0, j)] * if i == 0 { 1.0 } else { factor });
        });
        let s = solve("double", &double);
        assert!(s.is_solved && (s.gamma - gamma).abs() < 2e-9 * gamma);
        assert!(s.taps.lags().iter().all(|f| f.norm() < 1e2 / factor.abs().min(1.0)));
    }
    let zeroed = changed(&single, |_, p| {
        let h = p.h.clone();
        p.h = CMat::from_fn(2, 3, |i, j| if i == 0 { h[(0, j)] } else { Complex::default() });
    });
    let s = solve("zero second channel", &zeroed);
    assert!(s.is_solved && (s.gamma - gamma).abs() < 2e-9 * gamma);
    assert!(s.taps.lags().iter().all(|f| f.column(1).norm() == 0.0));
}

/// Channels that differ by a part in a million: ill-conditioned, still proven to the reduced gap.
#[test]
fn nearly_equal_channels_are_solved_to_the_reduced_gap() {
    let problem = random_problem(12, (2, 2, 4), 30, &[4, 4]);
    let near = changed(&problem, |_, p| {
        let first = p.h.row(0).into_owned();
        p.h.row_mut(1).iter_mut().zip(first.iter()).for_each(|(z, f)| *z = *f + *z * 1e-6);
    });
    let (s, apart) = (solve("nearly equal", &near), solve("apart", &problem));
    assert!(relative_gap(&s) < 1e-6, "{}", relative_gap(&s));
    // The span of the channels is the same, so the optimum is too.
    assert!((s.gamma - apart.gamma).abs() < 1e-6 * apart.gamma);
}

#[test]
fn the_same_bits_on_every_run() {
    let problem = random_problem(41, (2, 2, 4), 30, &[5, 5]);
    let (a, b) = (minimise(&problem, FINEST_GAP, &|| false), minimise(&problem, FINEST_GAP, &|| false));
    assert_eq!(a.unwrap().taps, b.unwrap().taps);
}

proptest::proptest! {
    #![proptest_config(proptest::test_runner::Config { cases: 24, failure_persistence: None, ..Default::default() })]

    /// Any shape, any strength of any channel: a proven gap, and a result in the problem's own units.
    #[test]
    fn any_problem_is_solved(
        seed in 0u64..1000, m in 1usize..4, n in 1usize..4, q in 1usize..6, points in 1usize..25,
        lags in 0usize..5, wanted in -9i32..9, channel in -9i32..9,
    ) {
        let plain = random_problem(seed, (m, n, q), points, &vec![lags; m]);
        let (up, gain) = (10f64.powi(wanted), 10f64.powi(channel));
        let problem = changed(&plain, |_, p| {
            p.w *= Complex::new(up, 0.0);
            p.h.row_mut(0).iter_mut().for_each(|z| *z *= gain);
        });
        let s = minimise(&problem, FINEST_GAP, &|| false).unwrap();
        check(&problem, &s);
        let zero = problem.worst(&problem.zero_taps()).unwrap();
                proptest::prop_assert!(s.gamma <= zero * (1.0 + 1e-12) && s.lower <= s.gamma * (1.0 + 1e-12));
        proptest::prop_assert!(s.gamma - s.lower <= (1e-6 * s.gamma).max(1e-12 * zero), "{:?}", s);
    }
}
