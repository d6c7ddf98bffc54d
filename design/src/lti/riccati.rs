//! Discrete algebraic Riccati equations by structured doubling.
//!
//! X = F' X (I + G X)^-1 F + H with symmetric G and H, neither of them necessarily semidefinite.
//! Source: Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time
//! algebraic Riccati equations", Int. J. Control 77 (2004).

use hybank_linalg::Mat;

/// The doubling converges quadratically to the stabilising solution; near the limit of solvability the
/// error only halves per step. Sixty doublings are 2^60 steps of the underlying recursion.
const DOUBLING_LIMIT: usize = 60;
/// Steps of the plain recursion after the doubling.
const REFINEMENT_LIMIT: usize = 4;
/// Relative change at which the doubling has converged.
const CONVERGED_CHANGE: f64 = 1e-14;
/// A relative residual above this is not a solution; below it the caller decides.
const RESIDUAL_LIMIT: f64 = 1e-3;

/// A stabilising solution: the eigenvalues of (I + G X)^-1 F lie inside the unit circle.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RiccatiSolution {
    /// X, n x n, symmetric.
    pub(crate) x: Mat,
    /// ||F' X (I + G X)^-1 F + H - X||: X solves the equation exactly for an H that differs by this much.
    pub(crate) residual: f64,
}

/// Solves X = F' X (I + G X)^-1 F + H for the stabilising X; all matrices n x n. `None` if the doubling does
/// not converge or ends at no solution; one may still exist.
pub(crate) fn solve_doubling(f: &Mat, g: &Mat, h: &Mat) -> Option<RiccatiSolution> {
    let mut iterate = DoublingIterate { f: f.clone(), g: g.clone(), x: h.clone() };
    for _ in 0..DOUBLING_LIMIT {
        let change = iterate.double();
        if !change.is_finite() {
            return None;
        }
        if change <= CONVERGED_CHANGE {
            return verify(f, g, h, iterate.x);
        }
    }
    None
}

struct DoublingIterate {
    f: Mat,
    g: Mat,
    x: Mat,
}

impl DoublingIterate {
    /// One doubling; returns the relative change of x.
    fn double(&mut self) -> f64 {
        let n = self.f.nrows();
        let right = hybank_linalg::hstack(&[&self.f, &self.g]);
        let solved = hybank_linalg::solve(&identity_plus(&self.g, &self.x), &right);
        let (wf, wg) = (solved.columns(0, n), solved.columns(n, n));
        let dx = hybank_linalg::symmetric_part(&(self.f.transpose() * (&self.x * wf)));
        let dg = hybank_linalg::symmetric_part(&(&self.f * wg * self.f.transpose()));
        self.f = &self.f * wf;
        self.g += dg;
        let size = self.x.norm();
        self.x += &dx;
        dx.norm() / size.max(f64::MIN_POSITIVE).max(self.x.norm())
    }
}

fn identity_plus(g: &Mat, x: &Mat) -> Mat {
    let mut w = g * x;
    for i in 0..w.nrows() {
        w[(i, i)] += 1.0;
    }
    w
}

fn verify(f: &Mat, g: &Mat, h: &Mat, x: Mat) -> Option<RiccatiSolution> {
    let (x, residual) = refined(f, g, h, x);
    let closed_loop = hybank_linalg::solve(&identity_plus(g, &x), f);
    let stable = hybank_linalg::spectral_radius(&closed_loop).is_ok_and(|radius| radius < 1.0);
    (residual <= RESIDUAL_LIMIT * x.norm() && stable).then_some(RiccatiSolution { x, residual })
}

/// A few steps of the plain recursion, which contracts about its stabilising solution, as long as they help.
/// Returns the solution and its residual.
fn refined(f: &Mat, g: &Mat, h: &Mat, x: Mat) -> (Mat, f64) {
    let step = |x: &Mat| {
        let weight = x * hybank_linalg::inverse(&identity_plus(g, x));
        hybank_linalg::symmetric_part(&(f.transpose() * weight * f + h))
    };
    let gap = |a: &Mat, b: &Mat| Some((a - b).norm()).filter(|gap| gap.is_finite()).unwrap_or(f64::INFINITY);
    let (mut best, mut next) = (x.clone(), step(&x));
    let mut residual = gap(&next, &best);
    for _ in 0..REFINEMENT_LIMIT {
        let after = step(&next);
        let change = gap(&after, &next);
        if change >= residual {
            break;
        }
        (best, next, residual) = (next, after, change);
    }
    (best, residual)
}

/// The stabilising solution P (n x n) of the Riccati equation of the bounded real lemma (Green and Limebeer,
/// *Linear Robust Control*, 1995, appendix B) at the level g with `weight` on all states,
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
pub(crate) fn bounded_real_riccati(a: &Mat, b: &Mat, c: &Mat, d: &Mat, g: f64, weight: f64) -> Option<Mat> {
    let m = b.ncols();
    let r = Mat::identity(m, m) * g - d.tr_mul(d) / g;
    let dc = d.tr_mul(c) / g;
    let solved = hybank_linalg::solve_positive(&r, &dc).ok()?;
    let inverse_b = hybank_linalg::solve_positive(&r, &b.transpose()).ok()?;
    let f = a + b * &solved;
    let neg = -hybank_linalg::symmetric_part(&(b * inverse_b));
    let n = a.nrows();
    let h =
        hybank_linalg::symmetric_part(&(c.tr_mul(c) / g + dc.tr_mul(&solved) + Mat::identity(n, n) * weight));
    solve_doubling(&f, &neg, &h).map(|solution| hybank_linalg::symmetric_part(&solution.x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalar_equation_has_its_quadratic_root() {
        // x = f^2 x / (1 + g x) + h, i.e. g x^2 + (1 - f^2 - g h) x - h = 0.
        for (f, g, h) in
            [(0.9_f64, 1.0, 1.0), (1.7, 2.0, 0.3), (0.5, -0.1, 1.0), (0.99, 1e-6, 1e3), (40.0, 1.0, 1e-9)]
        {
            let scalar = |x| Mat::from_element(1, 1, x);
            let x = solve_doubling(&scalar(f), &scalar(g), &scalar(h)).unwrap().x[0];
            let b = 1.0 - f * f - g * h;
            let exact = (-b + (b * b + 4.0 * g * h).sqrt()) / (2.0 * g);
            assert!((x - exact).abs() < 1e-9 * exact.abs(), "{f} {g} {h}: {x} {exact}");
        }
    }

    #[test]
    fn agrees_with_the_plain_recursion() {
        let n = 5;
        let f = Mat::from_fn(n, n, |i, j| ((i * 3 + j * 7 + 1) as f64).sin() * 0.8);
        let c = Mat::from_fn(2, n, |i, j| ((i + 2 * j) as f64).cos());
        let b = Mat::from_fn(n, 2, |i, j| ((3 * i + j) as f64).sin());
        let (g, h) = (c.transpose() * c, &b * b.transpose());
        let x = solve_doubling(&f, &g, &h).unwrap().x;
        let mut plain = Mat::zeros(n, n);
        for _ in 0..2000 {
            plain = f.transpose() * &plain * hybank_linalg::solve(&identity_plus(&g, &plain), &f) + &h;
        }
        assert!((&x - &plain).norm() < 1e-10 * plain.norm());
    }

    #[test]
    fn delay_lines_are_exact() {
        let n = 7;
        let f = Mat::from_fn(n, n, |i, j| f64::from(u8::from(j == i + 1)));
        let mut h = Mat::zeros(n, n);
        h[(n - 1, n - 1)] = 1.0;
        let x = solve_doubling(&f.transpose(), &Mat::zeros(n, n), &h).unwrap().x;
        assert!((x - Mat::identity(n, n)).norm() < 1e-15);
    }

    #[test]
    fn no_stabilising_solution_is_said() {
        // Unit-circle eigenvalues: x = x / (1 - x) + 1 has no real root.
        let one = Mat::from_element(1, 1, 1.0);
        assert_eq!(solve_doubling(&one, &-&one, &one), None);
    }

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
