//! Controllability Gramians and the H2 norm, by square-root doubling.

use super::{LtiError, StateSpace};
use crate::linalg::{self, Mat};

/// 2^60 steps of any stable system are a steady state.
const DOUBLING_LIMIT: usize = 60;

/// Square root `S` of the controllability Gramian, `S S' = sum_k a^k b b' a'^k`, n x min(n, ...), by
/// the squared Smith iteration on the factor: S <- [S, a S], a <- a^2.
///
/// Fails with [`LtiError::IterationLimit`] when `a` is not stable.
pub fn controllability_root(a: &Mat, b: &Mat) -> Result<Mat, LtiError> {
    let mut root = linalg::lq_factor(b);
    let mut power = a.clone();
    let mut change = f64::INFINITY;
    for _ in 0..DOUBLING_LIMIT {
        let more = &power * &root;
        change = more.norm() / root.norm().max(f64::MIN_POSITIVE);
        if change < f64::EPSILON * 1e-2 || root.norm() == 0.0 {
            return Ok(root);
        }
        if !change.is_finite() {
            break;
        }
        root = linalg::lq_factor(&linalg::hstack(&[&root, &more])?);
        power = &power * &power;
    }
    Err(LtiError::IterationLimit { what: "the Gramian", limit: DOUBLING_LIMIT, change })
}

/// Square root of the observability Gramian, `S S' = sum_k a'^k c' c a^k`: see [`controllability_root`].
///
/// # Errors
/// [`LtiError::IterationLimit`] when `a` is not stable.
pub fn observability_root(a: &Mat, c: &Mat) -> Result<Mat, LtiError> {
    controllability_root(&a.transpose(), &c.transpose())
}

/// The H2 norm: square root of `trace(c P c' + d d')`, P the controllability Gramian.
pub fn h2_norm(system: &StateSpace) -> Result<f64, LtiError> {
    let root = controllability_root(system.a(), system.b())?;
    Ok(((system.c() * root).norm_squared() + system.d().norm_squared()).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_the_lyapunov_equation() {
        let a = Mat::from_row_slice(3, 3, &[0.5, 0.9, 0.0, -0.3, 0.7, 0.1, 0.0, 0.0, 0.999]);
        let b = Mat::from_row_slice(3, 2, &[1.0, 0.0, 0.0, 1e-3, 1e3, 0.0]);
        let root = controllability_root(&a, &b).unwrap();
        let p = &root * root.transpose();
        let residual = &a * &p * a.transpose() + &b * b.transpose() - &p;
        assert!(residual.norm() < 1e-13 * p.norm(), "{}", residual.norm());
    }

    #[test]
    fn a_delay_line_counts_its_samples() {
        let n = 9;
        let a = Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)));
        let mut b = Mat::zeros(n, 1);
        b[0] = 2.0;
        let system = StateSpace::new(a, b, Mat::from_element(1, n, 1.0), Mat::zeros(1, 1)).unwrap();
        assert!((h2_norm(&system).unwrap() - 6.0).abs() < 1e-13);
    }

    #[test]
    fn an_unstable_system_is_an_error() {
        let one = Mat::from_element(1, 1, 1.0);
        assert!(controllability_root(&(&one * 1.01), &one).is_err());
        assert!(controllability_root(&one, &one).is_err());
    }
}
