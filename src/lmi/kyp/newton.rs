//! The Newton system and its solution.

use super::covariance::Covariance;
use crate::linalg::{self, LinalgError, Mat};
use crate::lmi::factor::RegularisedCholesky;

/// A direction, or a step when multiplied by its length.
pub(super) struct Direction {
    pub(super) p: Mat,
    pub(super) x: Vec<f64>,
    pub(super) gamma: f64,
    pub(super) s: Mat,
    pub(super) w: Vec<f64>,
    pub(super) z: Mat,
}

/// The factored Newton system of an iterate, in the Nesterov-Todd scaling:
/// `G'SG = G^-1 Z G^-T = diag(lambda)`.
///
/// Directions are formed in scaled coordinates, where rounding errors are small beside every eigenvalue; in
/// the plain coordinates they would drown the small eigenvalues of S and Z near the optimum.
pub(super) struct Newton {
    pub(super) factor: RegularisedCholesky,
    /// Border in half-solved coordinates: lower triangle of its Gram matrix and orthonormal columns.
    pub(super) triangle: Mat,
    pub(super) columns: Mat,
    pub(super) g: Mat,
    pub(super) g_inverse: Mat,
    pub(super) lambda: Vec<f64>,
}

impl Newton {
    /// The system for `map` and `border` at the primal matrix `s` and the dual matrix `z`, both positive
    /// definite.
    pub(super) fn new(map: &Covariance, border: &Mat, s: &Mat, z: &Mat) -> Result<Self, LinalgError> {
        let (ls, lz) = (linalg::cholesky(s)?, linalg::cholesky(z)?);
        let svd = linalg::svd(&ls.tr_mul(&lz))?;
        let lambda = svd.s;
        let root = |k: usize| 1.0 / lambda[k].sqrt();
        let mut g = &lz * svd.v;
        g.column_iter_mut().enumerate().for_each(|(k, mut column)| column *= root(k));
        let mut g_inverse = (&ls * svd.u).transpose();
        g_inverse.row_iter_mut().enumerate().for_each(|(k, mut row)| row *= root(k));
        let weight = linalg::symmetric_part(&g_inverse.tr_mul(&g_inverse));
        let factor = RegularisedCholesky::new(map.newton(&weight, &weight))?;
        let (triangle, rows) = linalg::lq(&factor.solve_half(border).transpose());
        Ok(Self { factor, triangle, columns: rows.transpose(), g, g_inverse, lambda })
    }

    /// `H w + K x = image`, `K'w = required`, by an orthogonal projection in the coordinates where H is the
    /// identity: the dual equalities hold to rounding however ill-conditioned H is.
    pub(super) fn solve(&self, image: &Mat, required: &Mat) -> (Mat, Mat) {
        let half = self.factor.solve_half(image);
        let needed = linalg::solve_lower(&self.triangle, required);
        let component = self.columns.tr_mul(&half) - needed;
        let x = linalg::solve_lower_transposed(&self.triangle, &component);
        (self.factor.solve_half_transposed(&(half - &self.columns * component)), x)
    }

    /// Mehrotra's target: `(lambda_i + lambda_j)/2 (dS~ + dZ~)_ij = sigma_mu I - Lambda^2 - sym(dS~ dZ~)`.
    pub(super) fn target(&self, sigma_mu: f64, affine: &Direction) -> Mat {
        let s = self.g.tr_mul(&affine.s) * &self.g;
        let z = &self.g_inverse * &affine.z * self.g_inverse.transpose();
        let second = linalg::symmetric_part(&(s * z));
        Mat::from_fn(self.lambda.len(), self.lambda.len(), |i, j| {
            let (a, b) = (self.lambda[i], self.lambda[j]);
            let first = if i == j { sigma_mu - a * a } else { 0.0 };
            2.0 * (first - second[(i, j)]) / (a + b)
        })
    }
}
