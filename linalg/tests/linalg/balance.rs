use hybank_linalg::{Complex, Mat, eigenvalues, spectral_radius, to_complex};

/// A delay line of `n` states, driven with `gain` by a stable pair of states.
fn driven_line(n: usize, gain: f64) -> Mat {
    let mut m = Mat::zeros(n + 2, n + 2);
    m.view_mut((0, 0), (2, 2)).copy_from_slice(&[0.6, 0.4, -0.5, 0.6]);
    (m[(2, 0)], m[(2, 1)]) = (gain, 0.3 * gain);
    (3..n + 2).for_each(|i| m[(i, i - 1)] = 1.0);
    m
}

#[test]
fn a_gain_between_parts_does_not_move_the_eigenvalues() {
    let radius = (0.36f64 + 0.2).sqrt();
    for gain in [1e-300, 1e-9, 1.0, 1e9, 1e18, 1e300] {
        for n in [1, 2, 9, 40] {
            let m = driven_line(n, gain);
            let found = spectral_radius(&m).unwrap();
            assert!((found - radius).abs() < 1e-14, "{n} states after a gain of {gain:e}: {found}");
            // The other way round, and complex.
            let found = spectral_radius(&m.transpose()).unwrap();
            assert!((found - radius).abs() < 1e-14, "{n} states before {gain:e}: {found}");
            let values = eigenvalues(&to_complex(&m)).unwrap();
            assert_eq!(values.iter().filter(|z| z.norm() == 0.0).count(), n);
        }
    }
}

#[test]
fn units_of_the_states_do_not_move_the_eigenvalues() {
    // (x - 0.9)(x - 0.5)(x + 0.7) as a companion matrix, in units that differ by 24 decades.
    let m = Mat::from_row_slice(3, 3, &[0.7, 0.53, -0.315, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let units = [1e12, 1.0, 1e-12];
    let scaled = Mat::from_fn(3, 3, |i, j| m[(i, j)] * units[i] / units[j]);
    let mut found: Vec<Complex<f64>> = eigenvalues(&scaled).unwrap();
    found.sort_by(|a, b| a.re.total_cmp(&b.re));
    for (z, want) in found.iter().zip([-0.7, 0.5, 0.9]) {
        assert!((z - Complex::new(want, 0.0)).norm() < 1e-14, "{z} is {want}");
    }
}

#[test]
fn loops_that_drive_one_another_are_blocks_of_their_own() {
    // Two rotations, the one driving the other with 1e12: no state is free of loops, but the two parts
    // are.
    let mut m = Mat::zeros(4, 4);
    for (at, angle) in [(0, 0.3f64), (2, 1.1)] {
        let (s, c) = angle.sin_cos();
        m.view_mut((at, at), (2, 2)).copy_from_slice(&[0.9 * c, 0.9 * s, -0.9 * s, 0.9 * c]);
    }
    m[(2, 1)] = 1e12;
    for z in eigenvalues(&m).unwrap() {
        assert!((z.norm() - 0.9).abs() < 1e-13, "{z}");
    }
}

#[test]
fn long_loops_are_scaled_too() {
    // x^n = a^n; the first loop drives the second one, which is in other units.
    let n = 30;
    let mut m = Mat::zeros(2 * n, 2 * n);
    for (start, a) in [(0, 0.9), (n, 0.6)] {
        (0..n).for_each(|i| m[(start + i, start + (i + n - 1) % n)] = a);
    }
    m[(n, n - 1)] = 1e9;
    // The larger state drives with its inverse.
    m.row_mut(n + 7).scale_mut(1e12);
    m.column_mut(n + 7).scale_mut(1e-12);
    let values = eigenvalues(&m).unwrap();
    let count = |a: f64| values.iter().filter(|z| (z.norm() - a).abs() < 1e-13).count();
    assert_eq!((count(0.9), count(0.6)), (n, n), "{values:?}");
}

#[test]
fn gains_at_the_ends_of_double_precision_do_no_harm() {
    let mut m = Mat::zeros(10, 10);
    for at in (0..10).step_by(2) {
        m.view_mut((at, at), (2, 2)).copy_from_slice(&[0.0, 1e-100, -1e-110, 0.0]);
    }
    (1..9).step_by(2).for_each(|i| m[(i + 1, i)] = 1e300);
    for z in eigenvalues(&m).unwrap() {
        assert!((z.norm() / 1e-105 - 1.0).abs() < 1e-12, "{z}");
    }
}

#[test]
fn the_trace_is_kept_on_dense_and_diagonal_matrices() {
    let dense = Mat::from_fn(7, 7, |i, j| (1.3 * (i * 7 + j) as f64).sin());
    let diagonal = Mat::from_fn(5, 5, |i, j| if i == j { i as f64 - 2.0 } else { 0.0 });
    for m in [dense, diagonal, Mat::zeros(3, 3), Mat::zeros(0, 0)] {
        let sum: Complex<f64> = eigenvalues(&m).unwrap().iter().sum();
        assert!((sum - Complex::new(m.trace(), 0.0)).norm() < 1e-13);
        assert_eq!(eigenvalues(&m).unwrap().len(), m.nrows());
    }
}
