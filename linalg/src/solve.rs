//! LQ, LU and Cholesky factorisations, and the systems that they solve.

use super::{LinalgError, Mat, Scalar, owned, view};
use faer::Side;
use faer::linalg::solvers::{DenseSolveCore, Llt, LltError, Solve};
use nalgebra::DMatrix;

/// Lower trapezoidal `L` (rows x min(rows, cols)) with `L L* = m m*`, by a QR factorisation of `m*`. It
/// compresses a square root without squaring it.
pub fn lq_factor<T: Scalar>(m: &DMatrix<T>) -> DMatrix<T> {
    if m.is_empty() { DMatrix::zeros(m.nrows(), m.nrows().min(m.ncols())) } else { T::lq_factor(m) }
}

/// Thin `(L, Q)` with `m = L Q`, `Q Q* = I`.
pub fn lq<T: Scalar>(m: &DMatrix<T>) -> (DMatrix<T>, DMatrix<T>) {
    let k = m.nrows().min(m.ncols());
    if m.is_empty() { (DMatrix::zeros(m.nrows(), k), DMatrix::zeros(k, m.ncols())) } else { T::lq(m) }
}

/// Solves the square system `m x = rhs` by LU with partial pivoting. A singular `m` gives infinities or
/// NaN, for which the caller must check.
pub fn solve<T: Scalar>(m: &DMatrix<T>, rhs: &DMatrix<T>) -> DMatrix<T> {
    T::solve(m, rhs)
}

/// Inverse by LU with partial pivoting; see [`solve`] for singular matrices.
pub fn inverse(m: &Mat) -> Mat {
    owned(view(m).partial_piv_lu().inverse().as_ref())
}

/// Solves `l x = rhs` with a lower triangular `l`.
pub fn solve_lower(l: &Mat, rhs: &Mat) -> Mat {
    let mut x = view(rhs).to_owned();
    view(l).solve_lower_triangular_in_place(x.as_mut());
    owned(x.as_ref())
}

/// Lower Cholesky factor of a symmetric matrix; only the lower triangle is read.
pub fn cholesky(m: &Mat) -> Result<Mat, LinalgError> {
    Ok(owned(PositiveFactor::new(m)?.llt.L()))
}

/// Solves `m x = rhs` for a symmetric positive definite `m` (lower triangle read).
pub fn solve_positive(m: &Mat, rhs: &Mat) -> Result<Mat, LinalgError> {
    Ok(PositiveFactor::new(m)?.solve(rhs))
}

/// Cholesky factorisation of a symmetric positive definite matrix, kept for many right-hand sides.
///
/// ```
/// use hybank_linalg::{LinalgError, Mat, PositiveFactor};
/// let factor = PositiveFactor::new(&Mat::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 2.0]))?;
/// let column = |a, b| Mat::from_row_slice(2, 1, &[a, b]);
/// assert!((factor.solve(&column(8.0, 6.0)) - column(1.0, 2.0)).norm() < 1e-15);
/// let indefinite = PositiveFactor::new(&Mat::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]));
/// assert_eq!(indefinite.unwrap_err(), LinalgError::NotPositiveDefinite { pivot: 1 });
/// # Ok::<(), LinalgError>(())
/// ```
#[derive(Debug, Clone)]
pub struct PositiveFactor {
    llt: Llt<f64>,
}

impl PositiveFactor {
    /// Factors `m`; only the lower triangle is read.
    pub fn new(m: &Mat) -> Result<Self, LinalgError> {
        match view(m).llt(Side::Lower) {
            Ok(llt) => Ok(Self { llt }),
            Err(LltError::NonPositivePivot { index }) => {
                Err(LinalgError::NotPositiveDefinite { pivot: index })
            }
        }
    }

    /// `m^{-1} rhs`.
    pub fn solve(&self, rhs: &Mat) -> Mat {
        owned(self.llt.solve(view(rhs)).as_ref())
    }
}
