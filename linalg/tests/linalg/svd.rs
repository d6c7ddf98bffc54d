use hybank_linalg::{CMat, Complex, LinalgError, Mat, largest_singular_value, singular_values, svd};

const SHAPES: [(usize, usize); 13] = [
    (0, 3),
    (1, 1),
    (1, 5),
    (4, 1),
    (2, 2),
    (2, 6),
    (5, 2),
    (3, 3),
    (4, 7),
    (7, 3),
    (8, 35),
    (35, 8),
    (12, 12),
];

#[test]
fn svd_is_right_on_rank_one_matrices() {
    for n in 2..16 {
        let m = Mat::from_element(n, n, 1.0);
        let svd = svd(&m).unwrap();
        let back = &svd.u * Mat::from_diagonal(&svd.s.clone().into()) * svd.v.transpose();
        assert!((svd.s[0] - n as f64).abs() < 1e-12, "n = {n}, sigma = {}", svd.s[0]);
        assert!((back - m).norm() < 1e-12);
    }
}

#[test]
fn the_largest_of_equal_singular_values_is_one_of_them() {
    for n in 1..16 {
        let turned = CMat::from_fn(n, n, |i, j| {
            Complex::from_polar((n as f64).sqrt().recip(), (i * j) as f64 * std::f64::consts::TAU / n as f64)
        });
        assert!((largest_singular_value(&turned).unwrap() - 1.0).abs() < 1e-14);
    }
}

#[test]
fn largest_singular_value_agrees_with_the_decomposition() {
    for (rows, cols) in SHAPES {
        for (seed, scale) in [(1.0, 1.0), (2.0, 1e-100), (3.0, 1e100), (4.0, 0.0)] {
            let entry = |i: usize, j: usize| {
                let x = seed + (3 * i + 7 * j) as f64;
                Complex::new(scale * x.sin(), scale * (1.7 * x).cos())
            };
            let m = CMat::from_fn(rows, cols, entry);
            let want = if rows == 0 { 0.0 } else { singular_values(&m).unwrap()[0] };
            let got = largest_singular_value(&m).unwrap();
            assert!((got - want).abs() <= 1e-14 * want, "{rows} x {cols} at {scale}: {got} {want}");
        }
    }
}

#[test]
fn a_not_finite_matrix_has_no_largest_singular_value() {
    for n in [1, 2, 3] {
        let m = CMat::from_element(n, n, Complex::new(f64::NAN, 0.0));
        assert!(matches!(largest_singular_value(&m), Err(LinalgError::NotFinite { .. })));
    }
}
