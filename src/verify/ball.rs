//! Matrices of enclosed numbers.

use crate::arithmetic::{BigFloat, DoubleDouble, Number, OUTWARD};
use nalgebra::DMatrix;

pub(super) use crate::arithmetic::Ball;

/// Matrix of enclosed numbers.
pub(super) type Matrix<F = DoubleDouble> = DMatrix<Ball<F>>;

/// The matrix of exactly these doubles.
pub(super) fn exact<F: Number>(m: &DMatrix<f64>) -> Matrix<F> {
    m.map(Ball::from)
}

/// The same in the precision of `F`.
pub(super) fn shortened<F: Number>(m: &Matrix<BigFloat>) -> Matrix<F> {
    m.map(Ball::shortened)
}

pub(super) fn zeros<F: Number>(rows: usize, columns: usize) -> Matrix<F> {
    Matrix::from_element(rows, columns, Ball::ZERO)
}

pub(super) fn identity<F: Number>(order: usize) -> Matrix<F> {
    Matrix::from_fn(order, order, |i, j| Ball::from(f64::from(u8::from(i == j))))
}

pub(super) fn add<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    a.zip_map(b, |x, y| x + y)
}

pub(super) fn subtract<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    a.zip_map(b, |x, y| x - y)
}

pub(super) fn scaled<F: Number>(a: &Matrix<F>, by: Ball<F>) -> Matrix<F> {
    a.map(|x| x * by)
}

/// a b. Entries of `a` that are exactly zero are skipped, because most matrices here are sparse.
pub(super) fn product<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    assert_eq!(a.ncols(), b.nrows(), "the matrices of a product fit each other");
    let mut result = zeros(a.nrows(), b.ncols());
    for i in 0..a.nrows() {
        let row: Vec<(usize, Ball<F>)> =
            (0..a.ncols()).map(|k| (k, a[(i, k)])).filter(|(_, x)| !x.is_zero()).collect();
        for j in 0..b.ncols() {
            result[(i, j)] = row.iter().fold(Ball::ZERO, |sum, &(k, x)| sum + x * b[(k, j)]);
        }
    }
    result
}

/// a b'.
pub(super) fn product_transposed<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    product(a, &b.transpose())
}

/// a s a' for a symmetric s.
pub(super) fn congruence<F: Number>(a: &Matrix<F>, s: &Matrix<F>) -> Matrix<F> {
    // The second product in the form (a (a s)')', so that the sparse factor stands on the left.
    symmetric(&product(a, &product(a, s).transpose()))
}

/// Copies one triangle into the other, so that the matrix is exactly symmetric. Both triangles must enclose
/// the same numbers.
pub(super) fn symmetric<F: Number>(m: &Matrix<F>) -> Matrix<F> {
    Matrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i.max(j), i.min(j))])
}

/// A bound on the largest sum of moduli in a row.
pub(super) fn row_sum<F: Number>(m: &Matrix<F>) -> f64 {
    let sum = |i: usize| m.row(i).iter().fold(0.0, |sum, x| (sum + x.magnitude()) * OUTWARD);
    (0..m.nrows()).map(sum).fold(0.0, nan_max)
}

/// A bound on the sum of the radii in each row.
pub(super) fn row_radii<F: Number>(m: &Matrix<F>) -> Vec<f64> {
    m.row_iter().map(|row| row.iter().fold(0.0, |sum, x| (sum + x.radius()) * OUTWARD)).collect()
}

/// The same for radii only: a bound on the spectral norm of a symmetric matrix within the radii.
pub(super) fn radius_sum<F: Number>(m: &Matrix<F>) -> f64 {
    row_radii(m).into_iter().fold(0.0, nan_max)
}

/// The larger one; NaN if either is NaN, so that an unknown bound stays unknown.
pub(super) fn nan_max(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// The nearest doubles to the midpoints.
pub(super) fn nearest<F: Number>(m: &Matrix<F>) -> DMatrix<f64> {
    m.map(Ball::nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_unknown_stays_unknown() {
        let unknown = Ball::<DoubleDouble>::from(1.0) / Ball::from(1e-9).widened(1e-8);
        assert!(row_sum(&Matrix::from_element(1, 1, unknown)).is_nan());
    }
}
