//! Matrices of enclosed numbers.

use crate::arithmetic::{DoubleDouble, Float, Float512, MatrixEntry, OUTWARD};
use nalgebra::DMatrix;

pub(super) use crate::arithmetic::Ball;
pub(super) use crate::arithmetic::dense::{congruence, identity, product, symmetric, zeros};

/// Matrix of enclosed numbers.
pub(super) type Matrix<F = DoubleDouble> = DMatrix<Ball<F>>;

/// The matrix of exactly these doubles.
pub(super) fn exact<F: Float>(m: &DMatrix<f64>) -> Matrix<F> {
    m.map(Ball::from)
}

/// The same in the precision of `F`.
pub(super) fn shortened<F: Float>(m: &Matrix<Float512>) -> Matrix<F> {
    m.map(Ball::shortened)
}

pub(super) fn scaled<F: Float>(a: &Matrix<F>, by: Ball<F>) -> Matrix<F> {
    a.map(|x| x * by)
}

/// a b'.
pub(super) fn product_transposed<F: Float>(a: &Matrix<F>, b: &Matrix<F>) -> Matrix<F> {
    product(a, &b.transpose())
}

/// a, and b below it.
pub(super) fn above<T: MatrixEntry>(a: &DMatrix<T>, b: &DMatrix<T>) -> DMatrix<T> {
    let entry = |i: usize, j: usize| if i < a.nrows() { a[(i, j)] } else { b[(i - a.nrows(), j)] };
    DMatrix::from_fn(a.nrows() + b.nrows(), a.ncols(), entry)
}

/// A bound on the largest sum of moduli in a row.
pub(super) fn row_sum<F: Float>(m: &Matrix<F>) -> f64 {
    let sum = |i: usize| m.row(i).iter().fold(0.0, |sum, x| (sum + x.magnitude()) * OUTWARD);
    (0..m.nrows()).map(sum).fold(0.0, nan_max)
}

/// A bound on the sum of the radii in each row.
pub(super) fn row_radii<F: Float>(m: &Matrix<F>) -> Vec<f64> {
    m.row_iter().map(|row| row.iter().fold(0.0, |sum, x| (sum + x.radius()) * OUTWARD)).collect()
}

/// The same for radii only: a bound on the spectral norm of a symmetric matrix within the radii.
pub(super) fn radius_sum<F: Float>(m: &Matrix<F>) -> f64 {
    row_radii(m).into_iter().fold(0.0, nan_max)
}

/// The larger one; NaN if either is NaN, so that an unknown bound stays unknown.
pub(super) fn nan_max(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// The nearest doubles to the midpoints.
pub(super) fn nearest<F: Float>(m: &Matrix<F>) -> DMatrix<f64> {
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
