//! Small linear problems.

use hybank_linalg::small::{least_squares, least_vector, svd3};
use nalgebra::Matrix3;

#[test]
fn the_least_vector_spans_the_null_space() {
    let rows = [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [1.0, 0.0, -1.0], [5.0, 5.0, 5.0]];
    let (v, s) = least_vector(&rows).unwrap();
    assert!(s[2] < 1e-14 && s[1] > 0.1);
    for row in rows {
        assert!(row.iter().zip(v.iter()).map(|(a, b)| a * b).sum::<f64>().abs() < 1e-14);
    }
    let (v, s) = least_vector(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
    assert!((v[2].abs() - 1.0).abs() < 1e-15 && s[2] == 0.0);
    assert!(least_vector(&[[f64::NAN, 0.0]]).is_none());
}

#[test]
fn rank_one_is_decomposed() {
    let m = Matrix3::from_element(1.0);
    let (u, s, v) = svd3(&m).unwrap();
    assert!((s[0] - 3.0).abs() < 1e-14 && s[1] < 1e-14);
    let back = u * Matrix3::from_diagonal(&s.into()) * v.transpose();
    assert!((back - m).norm() < 1e-14);
}

#[test]
fn least_squares_has_an_orthogonal_residual() {
    let rows = [[1.0, 0.0], [1.0, 1.0], [1.0, 2.0], [1.0, 3.0]];
    let rhs = [1.0, 0.0, 2.0, 1.0];
    let x = least_squares(&rows, &rhs).unwrap();
    for column in 0..2 {
        let dot: f64 = rows.iter().zip(rhs).map(|(r, b)| r[column] * (r[0] * x[0] + r[1] * x[1] - b)).sum();
        assert!(dot.abs() < 1e-13);
    }
    assert!(least_squares(&[[1.0, 1.0], [2.0, 2.0]], &[1.0, 2.0]).is_none());
}
