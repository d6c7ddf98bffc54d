use hybank_linalg::{LinalgError, Mat, eigenvalues, spectral_radius, svd};

fn delay_line(n: usize) -> Mat {
    Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)))
}

#[test]
fn eigenvalues_end_on_delay_lines_and_cyclic_shifts() {
    for n in 2..17 {
        assert!(spectral_radius(&delay_line(n)).unwrap() < 1e-12);
        let mut cyclic = delay_line(n);
        cyclic[(0, n - 1)] = 1.0;
        for z in eigenvalues(&cyclic).unwrap() {
            assert!((z.norm() - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn non_finite_input_is_refused() {
    let m = Mat::from_element(3, 3, f64::NAN);
    assert!(matches!(eigenvalues(&m), Err(LinalgError::NotFinite { .. })));
    assert!(matches!(svd(&m), Err(LinalgError::NotFinite { .. })));
}
