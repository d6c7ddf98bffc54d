//! Proves that every matrix in an enclosure of a symmetric matrix is positive definite.
//!
//! If a Cholesky factorisation in floating point runs to its end, the matrix it was given differs from a
//! positive semidefinite one by at most g tr in the spectral norm, g = (n + 2) u / (1 - (n + 2) u), u the
//! relative error of an operation (Demmel's bound; S. M. Rump, *Verification of positive definiteness*, BIT
//! 46, 2006; N. J. Higham, *Accuracy and Stability of Numerical Algorithms*, theorems 10.3 and 10.5). So
//! the midpoint less (radii + g tr + margin) I is factored.

use super::ball::{self, Ball, Matrix};
use crate::arithmetic::Number;
use crate::arithmetic::dense::{cholesky, solve_factored};
use nalgebra::DMatrix;

/// Shift of a matrix whose diagonal is one: some thousand roundings of 106 bits, so that rounding makes no
/// semidefinite matrix indefinite.
const SEMIDEFINITE_SHIFT: f64 = 1e-28;
/// Makes up for the roundings of a sum of bounds in double precision, up to 10^12 terms.
pub(super) const SUM_OUTWARD: f64 = 1.001;
/// Bound of a factorisation's error over its first-order term: the higher ones are far smaller than it.
const FACTORING: f64 = 2.0;
/// A lower bound of eigenvalues over the error that any proof of it must grant.
const LEAST_BOUND: f64 = 2.0;

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
pub(super) fn scales<F: Number>(m: &Matrix<F>) -> Vec<f64> {
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
pub(super) fn is_positive_definite<F: Number>(m: &Matrix<F>) -> bool {
    exceeds(&scaled(m, &scales(m)), 0.0)
}

/// D m D with D diagonal; the lower triangle of m is read.
pub(super) fn scaled<F: Number>(m: &Matrix<F>, scales: &[f64]) -> Matrix<F> {
    Matrix::from_fn(m.nrows(), m.ncols(), |i, j| {
        m[(i.max(j), i.min(j))] * Ball::from(scales[i]) * Ball::from(scales[j])
    })
}

/// Whether every symmetric matrix in the enclosure has no eigenvalue below `least`.
pub(super) fn exceeds<F: Number>(m: &Matrix<F>, least: f64) -> bool {
    let n = m.nrows();
    let shift = (ball::radius_sum(m) + factoring(m, least)) * SUM_OUTWARD + least;
    let shifted = DMatrix::from_fn(n, n, |i, j| {
        let (i, j) = (i.max(j), i.min(j));
        if i == j { (m[(i, j)] - Ball::from(shift)).mid() } else { m[(i, j)].mid() }
    });
    shift.is_finite() && cholesky(&shifted).is_some()
}

/// A bound on the error of a factorisation of `m` less a shift of about `least`.
fn factoring<F: Number>(m: &Matrix<F>, least: f64) -> f64 {
    let n = m.nrows();
    let trace: f64 = (0..n).map(|i| m[(i, i)].magnitude()).sum();
    FACTORING * (n + 2) as f64 * F::ROUNDING * (trace + n as f64 * least.abs())
}

/// A symmetric matrix of which every one in its enclosure is positive definite.
#[derive(Debug, Clone)]
pub(super) struct Definite<F> {
    matrix: Matrix<F>,
    factor: DMatrix<F>,
    /// No eigenvalue is less.
    least: f64,
}

impl<F: Number> Definite<F> {
    /// `None` if that is not shown with the precision of F.
    pub(super) fn new(matrix: Matrix<F>) -> Option<Self> {
        let least = LEAST_BOUND * (ball::radius_sum(&matrix) + factoring(&matrix, 0.0));
        let shown = least > 0.0 && exceeds(&matrix, least);
        let factor = if shown { cholesky(&matrix.map(Ball::mid)) } else { None };
        factor.map(|factor| Self { matrix, factor, least })
    }

    pub(super) fn order(&self) -> usize {
        self.matrix.nrows()
    }

    /// At least r' M^-1 r, for all in the enclosures: with any v and rho = r - M v it is
    /// v' r + v' rho + rho' M^-1 rho.
    pub(super) fn inverse_form(&self, r: &Matrix<F>) -> Ball<F> {
        let v = solve_factored(&self.factor, &r.map(Ball::mid)).map(Ball::exactly);
        let rho = r - ball::product(&self.matrix, &v);
        let inner =
            |x: &Matrix<F>, y: &Matrix<F>| x.iter().zip(y).fold(Ball::ZERO, |sum, (&x, &y)| sum + x * y);
        inner(&v, r) + inner(&v, &rho) + inner(&rho, &rho) / Ball::from(self.least)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::DoubleDouble;
    use crate::linalg::hermitian_eigenvalues;

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
    fn a_margin_is_met_and_not_exceeded() {
        let m = with_eigenvalues(&[1.0, 3.0, 0.25, 2.0]);
        assert!(exceeds(&m, 0.2499999999999999) && !exceeds(&m, 0.2500000000000001));
        let eigenvalues = hermitian_eigenvalues(&ball::nearest(&m)).unwrap();
        assert!((eigenvalues[0] - 0.25).abs() < 1e-14);
    }

    #[test]
    fn radii_are_charged() {
        let m = with_eigenvalues(&[1.0, 3.0, 0.25, 2.0]);
        assert!(exceeds(&m.map(|x| x.widened(0.06)), 0.0));
        assert!(!exceeds(&m.map(|x| x.widened(0.07)), 0.0));
        assert!(!is_positive_definite(&m.map(|x| x.widened(f64::NAN))));
    }

    #[test]
    fn units_do_not_matter() {
        let units = [1e-12, 1.0, 1e9, 1e-3];
        let m = with_eigenvalues(&[1.0, 3.0, 1e-9, 2.0]);
        let changed = Matrix::from_fn(4, 4, |i, j| m[(i, j)] * Ball::from(units[i]) * Ball::from(units[j]));
        assert!(is_positive_definite(&changed));
    }

    #[test]
    fn solutions_solve() {
        let m = with_eigenvalues(&[1.0, 3.0, 1e-9, 2.0]);
        let factor = cholesky(&m.map(Ball::mid)).unwrap();
        let solved = |v: &DMatrix<DoubleDouble>| solve_factored(&factor, v);
        let [v, w] = [[1.0, -2.0, 0.5, 3.0], [0.25, 1.0, -3.0, 7.0]]
            .map(|v| DMatrix::from_iterator(4, 1, v.map(DoubleDouble::from)));
        let back = ball::product(&m, &solved(&v).map(Ball::exactly));
        assert!((0..4).all(|i| (back[i].mid() - v[i]).nearest().abs() < 1e-18));
        // The inverse acts linearly, so x(v) + x(w) = x(v + w).
        let (x, y, z) = (solved(&v), solved(&w), solved(&(&v + &w)));
        assert!((0..4).all(|i| (x[i] + y[i] - z[i]).nearest().abs() < 1e-18 * (1.0 + z[i].nearest().abs())));
    }
}
