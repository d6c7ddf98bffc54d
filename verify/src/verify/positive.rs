//! Proves that every matrix in an enclosure of a symmetric matrix is positive definite.
//!
//! If a Cholesky factorisation in floating point runs to its end, the matrix it was given differs from a
//! positive semidefinite one by at most g tr in the spectral norm, g = (n + 2) u / (1 - (n + 2) u), u the
//! relative error of an operation (Demmel's bound; S. M. Rump, *Verification of positive definiteness*, BIT
//! 46, 2006; N. J. Higham, *Accuracy and Stability of Numerical Algorithms*, theorems 10.3 and 10.5). So
//! the midpoint less (radii + g tr) I is factored.

use super::ball::{self, Ball, Matrix};
use crate::arithmetic::Float;
use crate::arithmetic::dense::cholesky;
use nalgebra::DMatrix;

/// Shift of a matrix whose diagonal is one: some thousand roundings of 106 bits, so that rounding makes no
/// semidefinite matrix indefinite.
const SEMIDEFINITE_SHIFT: f64 = 1e-28;
/// Makes up for the roundings of a sum of bounds in double precision, up to 10^12 terms.
pub(super) const SUM_OUTWARD: f64 = 1.001;
/// Bound of a factorisation's error over its first-order term: the higher ones are far smaller than it.
const FACTORING: f64 = 2.0;

/// R with R R' = m up to [`SEMIDEFINITE_SHIFT`] of its size. The result is rounded and must not be used in a
/// proof.
pub(super) fn root(m: &Matrix) -> Option<Matrix> {
    let n = m.nrows();
    let scales = scales(m);
    let shifted = DMatrix::from_fn(n, n, |i, j| {
        let scaled = m[(i, j)] * Ball::from(scales[i]) * Ball::from(scales[j]);
        if i == j { (scaled + Ball::from(SEMIDEFINITE_SHIFT)).mid() } else { scaled.mid() }
    });
    let factor = cholesky(&shifted)?;
    Some(Matrix::from_fn(n, n, |i, j| Ball::exactly(factor[(i, j)]) / Ball::from(scales[i])))
}

/// Powers of two that bring the diagonal of a matrix to the size of one: the scaling is exact, and the
/// proof does not depend on units.
fn scales<F: Float>(m: &Matrix<F>) -> Vec<f64> {
    let power = |i: usize| {
        let diagonal = m[(i, i)].nearest();
        if diagonal > 0.0 && diagonal.is_finite() {
            2f64.powi((-0.5 * diagonal.log2()).round() as i32)
        } else {
            1.0
        }
    };
    (0..m.nrows()).map(power).collect()
}

/// Whether every symmetric matrix in the enclosure `m` (lower triangle read) is positive definite.
pub(super) fn is_positive_definite<F: Float>(m: &Matrix<F>) -> bool {
    let (n, scales) = (m.nrows(), scales(m));
    let scaled =
        Matrix::from_fn(n, n, |i, j| m[(i.max(j), i.min(j))] * Ball::from(scales[i]) * Ball::from(scales[j]));
    let shift = (ball::radius_sum(&scaled) + factoring(&scaled)) * SUM_OUTWARD;
    let shifted = DMatrix::from_fn(n, n, |i, j| {
        if i == j { (scaled[(i, j)] - Ball::from(shift)).mid() } else { scaled[(i, j)].mid() }
    });
    shift.is_finite() && cholesky(&shifted).is_some()
}

/// A bound on the error of a factorisation of `m` less a shift that is small beside it.
fn factoring<F: Float>(m: &Matrix<F>) -> f64 {
    let n = m.nrows();
    let trace: f64 = (0..n).map(|i| m[(i, i)].magnitude()).sum();
    FACTORING * (n + 2) as f64 * F::ROUNDING * trace
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Q diag(values) Q' with a Householder reflection: eigenvalues known beforehand.
    fn with_eigenvalues(values: &[f64]) -> Matrix {
        let n = values.len();
        let v: Vec<Ball> = (0..n).map(|i| Ball::from(1.0 + i as f64)).collect();
        let square = v.iter().fold(Ball::ZERO, |sum, &x| sum + x * x);
        let q = Matrix::from_fn(n, n, |i, j| {
            Ball::from(f64::from(u8::from(i == j))) - Ball::from(2.0) * v[i] * v[j] / square
        });
        let d = Matrix::from_fn(n, n, |i, j| if i == j { Ball::from(values[i]) } else { Ball::ZERO });
        ball::congruence(&q, &d)
    }

    #[test]
    fn eigenvalues_far_below_double_precision_are_told_from_zero() {
        for least in [1.0, 1e-10, 1e-20, 1e-26] {
            assert!(is_positive_definite(&with_eigenvalues(&[1.0, 3.0, least, 2.0, 5.0])), "{least}");
            assert!(!is_positive_definite(&with_eigenvalues(&[1.0, 3.0, -least, 2.0, 5.0])), "{least}");
        }
        assert!(!is_positive_definite(&with_eigenvalues(&[1.0, 3.0, 0.0, 2.0, 5.0])));
    }

    #[test]
    fn radii_are_charged() {
        // The diagonal needs no scaling, and four radii make a row.
        let m = with_eigenvalues(&[0.9, 1.1, 0.6, 1.3]);
        assert!(is_positive_definite(&m.map(|x| x.widened(0.149))));
        assert!(!is_positive_definite(&m.map(|x| x.widened(0.151))));
        assert!(!is_positive_definite(&m.map(|x| x.widened(f64::NAN))));
    }

    #[test]
    fn units_do_not_matter() {
        let units = [1e-12, 1.0, 1e9, 1e-3];
        let m = with_eigenvalues(&[1.0, 3.0, 1e-9, 2.0]);
        let changed = Matrix::from_fn(4, 4, |i, j| m[(i, j)] * Ball::from(units[i]) * Ball::from(units[j]));
        assert!(is_positive_definite(&changed));
    }
}
