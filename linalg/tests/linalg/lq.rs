use hybank_linalg::{Mat, lq_factor};

#[test]
fn lq_factor_keeps_the_product_and_the_small_rows() {
    let m = Mat::from_fn(4, 9, |i, j| 1e-9_f64.powi(i as i32) * ((i * 7 + j * 3) as f64).sin());
    let l = lq_factor(&m);
    assert_eq!(l.shape(), (4, 4));
    for i in 0..4 {
        let (a, b) = (l.row(i).norm(), m.row(i).norm());
        assert!((a - b).abs() < 1e-13 * b, "row {i}: {a} {b}");
    }
}
