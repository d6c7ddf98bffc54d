//! Cholesky factorisations and their solutions of linear systems.

use super::{LinalgError, Mat, owned, view};
use faer::Side;
use faer::linalg::solvers::Solve;

/// Lower Cholesky factor of a symmetric matrix; only the lower triangle is read.
pub fn cholesky(m: &Mat) -> Result<Mat, LinalgError> {
    match view(m).llt(Side::Lower) {
        Ok(llt) => Ok(owned(llt.L())),
        Err(faer::linalg::solvers::LltError::NonPositivePivot { index }) => {
            Err(LinalgError::NotPositiveDefinite { pivot: index })
        }
    }
}

/// Solves `m x = rhs` for a symmetric positive definite `m` (lower triangle read).
pub fn solve_positive(m: &Mat, rhs: &Mat) -> Result<Mat, LinalgError> {
    match view(m).llt(Side::Lower) {
        Ok(llt) => Ok(owned(llt.solve(view(rhs)).as_ref())),
        Err(faer::linalg::solvers::LltError::NonPositivePivot { index }) => {
            Err(LinalgError::NotPositiveDefinite { pivot: index })
        }
    }
}

/// Cholesky factorisation of a symmetric positive definite matrix, kept for many right-hand sides.
#[derive(Debug, Clone)]
pub struct PositiveFactor {
    llt: faer::linalg::solvers::Llt<f64>,
}

impl PositiveFactor {
    /// Factors `m`; only the lower triangle is read.
    pub fn new(m: &Mat) -> Result<Self, LinalgError> {
        match view(m).llt(Side::Lower) {
            Ok(llt) => Ok(Self { llt }),
            Err(faer::linalg::solvers::LltError::NonPositivePivot { index }) => {
                Err(LinalgError::NotPositiveDefinite { pivot: index })
            }
        }
    }

    /// `m^{-1} rhs`.
    pub fn solve(&self, rhs: &Mat) -> Mat {
        owned(self.llt.solve(view(rhs)).as_ref())
    }

    /// `L^{-1} rhs` with the lower factor L, `m = L L'`.
    pub fn solve_half(&self, rhs: &Mat) -> Mat {
        let mut x = faer::Mat::from_fn(rhs.nrows(), rhs.ncols(), |i, j| rhs[(i, j)]);
        self.llt.L().solve_lower_triangular_in_place(x.as_mut());
        owned(x.as_ref())
    }

    /// `L'^{-1} rhs`, the other half.
    pub fn solve_half_transposed(&self, rhs: &Mat) -> Mat {
        let mut x = faer::Mat::from_fn(rhs.nrows(), rhs.ncols(), |i, j| rhs[(i, j)]);
        self.llt.L().transpose().solve_upper_triangular_in_place(x.as_mut());
        owned(x.as_ref())
    }
}
