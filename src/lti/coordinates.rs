//! State coordinates in which the controllability Gramian is the identity.

use super::LtiError;
use super::gramian::controllability_root;
use crate::linalg::{self, Mat};

/// Coordinates xi of the controllable states x (n of them) with the identity as controllability Gramian,
/// `A A' + B B' = I`: `x = basis xi` and `xi = inverse x`.
#[derive(Debug, Clone, PartialEq)]
pub struct GramianCoordinates {
    /// n x r.
    pub basis: Mat,
    /// r x n, `inverse basis = I`.
    pub inverse: Mat,
    /// A in these coordinates, `inverse A basis`.
    pub a: Mat,
    /// B in these coordinates, `inverse B`.
    pub b: Mat,
}

impl GramianCoordinates {
    /// Scales every state to unit variance, so that the units of the states do not matter, and drops the
    /// directions with a standard deviation below `tol_rank` times the largest.
    ///
    /// # Errors
    /// [`LtiError::IterationLimit`] if A is not stable, [`LtiError::Linalg`] if the decomposition does not
    /// converge.
    pub fn new(a: &Mat, b: &Mat, tol_rank: f64) -> Result<Self, LtiError> {
        let root = controllability_root(a, b)?;
        let n = a.nrows();
        let deviation: Vec<f64> = (0..n).map(|i| root.row(i).norm()).collect();
        let unit = |i: usize| if deviation[i] > 0.0 { 1.0 / deviation[i] } else { 0.0 };
        let svd = linalg::svd(&Mat::from_fn(n, root.ncols(), |i, j| unit(i) * root[(i, j)]))?;
        let floor = tol_rank * svd.s.first().copied().unwrap_or(0.0);
        let rank = svd.s.iter().filter(|s| **s > floor).count();
        let basis = Mat::from_fn(n, rank, |i, r| deviation[i] * svd.u[(i, r)] * svd.s[r]);
        let inverse = Mat::from_fn(rank, n, |r, i| svd.u[(i, r)] / svd.s[r] * unit(i));
        let (small_a, small_b) = (&inverse * a * &basis, &inverse * b);
        Ok(Self { basis, inverse, a: small_a, b: small_b })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gramian_is_one_and_uncontrollable_states_are_gone_whatever_the_units() {
        let a =
            Mat::from_row_slice(4, 4, &[0.9, 0.2, 0., 0., 0., 0.5, 0., 0., 0., 0., 0.3, 0., 0., 0., 1.0, 0.]);
        let b = Mat::from_row_slice(4, 1, &[0.0, 1.0, 0.0, 0.0]);
        for scale in [1e-9, 1.0, 1e9] {
            let units = Mat::from_diagonal(&nalgebra::dvector![1.0, scale, 1.0, 1.0]);
            let back = Mat::from_diagonal(&nalgebra::dvector![1.0, 1.0 / scale, 1.0, 1.0]);
            let c = GramianCoordinates::new(&(&units * &a * &back), &(&units * &b), 1e-12).unwrap();
            assert_eq!(c.a.nrows(), 2);
            let unity = &c.a * c.a.transpose() + &c.b * c.b.transpose();
            assert!((unity - Mat::identity(2, 2)).norm() < 1e-12);
        }
    }

    #[test]
    fn an_unstable_system_is_refused() {
        let one = Mat::from_element(1, 1, 1.5);
        assert!(matches!(GramianCoordinates::new(&one, &one, 1e-12), Err(LtiError::IterationLimit { .. })));
    }
}
