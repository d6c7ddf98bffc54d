//! Step lengths in the cone of positive semidefinite matrices.

use crate::linalg::{self, LinalgError, Mat};

/// Largest alpha for which `m + alpha d` stays positive semidefinite (infinite if all do); m must be
/// positive definite.
pub(super) fn max_step(m: &Mat, d: &Mat) -> Result<f64, LinalgError> {
    if m.is_empty() {
        return Ok(f64::INFINITY);
    }
    let l = linalg::cholesky(m)?;
    let half = linalg::solve_lower(&l, d);
    let scaled = linalg::symmetric_part(&linalg::solve_lower(&l, &half.transpose()));
    let least = linalg::hermitian_eigenvalues(&scaled)?[0];
    Ok(if least < 0.0 { -1.0 / least } else { f64::INFINITY })
}
