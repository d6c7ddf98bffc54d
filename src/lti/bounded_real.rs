//! The Riccati equation of the bounded real lemma (Green and Limebeer, *Linear Robust Control*, 1995,
//! appendix B).

use super::riccati::{RiccatiOutcome, solve_doubling};
use crate::linalg::{self, Mat};

/// The stabilising solution P (n x n) of the bounded-real Riccati equation at the level g with `weight` on
/// all states,
///
/// ```text
/// P = A'PA + C'C/g + weight I + (A'PB + C'D/g) (g I - D'D/g - B'PB)^-1 (A'PB + C'D/g)'.
/// ```
///
/// For stable A, `weight` = 0 and g above the H-infinity norm of `C (zI - A)^-1 B + D` it exists, with
/// `P >= 0` and `g I - D'D/g - B'PB > 0`; a solution without these two signs says nothing about the norm. It
/// is solved by doubling in the form `P = F'P (I + G P)^-1 F + H` with `R = g I - D'D/g`,
/// `F = A + B R^-1 D'C/g`, `G = -B R^-1 B'`, `H = C'C/g + C'D R^-1 D'C/g^2 + weight I`.
///
/// `None` if g is not above the norm of D, or if the doubling finds no stabilising solution.
pub fn bounded_real_riccati(a: &Mat, b: &Mat, c: &Mat, d: &Mat, g: f64, weight: f64) -> Option<Mat> {
    let m = b.ncols();
    let r = Mat::identity(m, m) * g - d.tr_mul(d) / g;
    let dc = d.tr_mul(c) / g;
    let solved = linalg::solve_positive(&r, &dc).ok()?;
    let inverse_b = linalg::solve_positive(&r, &b.transpose()).ok()?;
    let f = a + b * &solved;
    let neg = -linalg::symmetric_part(&(b * inverse_b));
    let n = a.nrows();
    let h = linalg::symmetric_part(&(c.tr_mul(c) / g + dc.tr_mul(&solved) + Mat::identity(n, n) * weight));
    match solve_doubling(&f, &neg, &h) {
        RiccatiOutcome::Solved(solution) => Some(linalg::symmetric_part(&solution.x)),
        RiccatiOutcome::Unresolved { .. } => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(value: f64) -> Mat {
        Mat::from_element(1, 1, value)
    }

    /// 1 / (z - 0.5) has the norm 2. Just above it the equation has a solution; between 2/3 and 2 its
    /// discriminant is negative.
    #[test]
    fn a_solution_exists_above_the_norm_and_not_below() {
        let solved = |g: f64| bounded_real_riccati(&one(0.5), &one(1.0), &one(1.0), &one(0.0), g, 0.0);
        assert!(solved(2.0 * (1.0 + 1e-6)).is_some());
        for g in [2.0 * (1.0 - 1e-6), 1.5, 0.7] {
            assert!(solved(g).is_none(), "{g}");
        }
    }

    #[test]
    fn the_solution_satisfies_the_equation() {
        let a = Mat::from_row_slice(3, 3, &[0.8, 0.5, 0.0, -0.3, 0.6, 0.2, 0.0, 0.1, 0.4]);
        let b = Mat::from_row_slice(3, 2, &[1.0, 0.0, 0.3, 1.0, 0.0, -0.7]);
        let c = Mat::from_row_slice(2, 3, &[1.0, -1.0, 0.5, 0.0, 2.0, 1.0]);
        let d = Mat::from_row_slice(2, 2, &[0.1, 0.0, -0.2, 0.3]);
        let (g, weight) = (40.0, 1e-3);
        let p = bounded_real_riccati(&a, &b, &c, &d, g, weight).unwrap();
        let cross = a.transpose() * &p * &b + c.transpose() * &d / g;
        let inner = Mat::identity(2, 2) * g - d.transpose() * &d / g - b.transpose() * &p * &b;
        let right = a.transpose() * &p * &a
            + c.transpose() * &c / g
            + Mat::identity(3, 3) * weight
            + &cross * inner.try_inverse().unwrap() * cross.transpose();
        assert!((&p - right).norm() < 1e-12 * p.norm());
    }

    #[test]
    fn a_level_below_the_feedthrough_has_no_solution() {
        assert!(bounded_real_riccati(&one(0.5), &one(1.0), &one(1.0), &one(5.0), 2.0, 0.0).is_none());
    }
}
