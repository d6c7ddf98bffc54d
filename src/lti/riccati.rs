//! Discrete algebraic Riccati equations by structured doubling.
//!
//! X = F' X (I + G X)^-1 F + H with symmetric G and H, neither of them necessarily semidefinite.
//! Source: Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time
//! algebraic Riccati equations", Int. J. Control 77 (2004).

use crate::linalg::{self, Mat};

/// The doubling converges quadratically to the stabilising solution; near the limit of solvability the
/// error only halves per step. Sixty doublings are 2^60 steps of the underlying recursion.
const DOUBLING_LIMIT: usize = 60;
/// Steps of the plain recursion after the doubling.
const REFINEMENT_LIMIT: usize = 4;
/// Relative change at which the doubling has converged.
const CONVERGED: f64 = 1e-14;
/// A relative residual above this is not a solution; below it the caller decides.
const RESIDUAL_LIMIT: f64 = 1e-3;

/// The result of a doubling. If it does not converge, a solution may still exist.
#[derive(Debug, Clone, PartialEq)]
pub enum RiccatiOutcome {
    /// The stabilising solution.
    Solved(RiccatiSolution),
    /// No solution was found.
    Unresolved {
        /// Doublings done.
        steps: usize,
        /// Last relative change, or relative residual when the change was small enough.
        error: f64,
    },
}

/// A stabilising solution with its closed loop and its residual.
#[derive(Debug, Clone, PartialEq)]
pub struct RiccatiSolution {
    /// X, n x n, symmetric.
    pub x: Mat,
    /// (I + G X)^-1 F, whose eigenvalues lie inside the unit circle.
    pub closed_loop: Mat,
    /// Doublings done.
    pub steps: usize,
    /// ||F' X (I + G X)^-1 F + H - X||: X solves the equation exactly for an H that differs by this much.
    pub residual: f64,
}

/// Solves X = F' X (I + G X)^-1 F + H for the stabilising X; all matrices n x n.
pub fn solve_doubling(f: &Mat, g: &Mat, h: &Mat) -> RiccatiOutcome {
    let mut iterate = Iterate { f: f.clone(), g: g.clone(), x: h.clone() };
    let mut change = f64::INFINITY;
    for steps in 1..=DOUBLING_LIMIT {
        change = iterate.double();
        if !change.is_finite() {
            return RiccatiOutcome::Unresolved { steps, error: change };
        }
        if change <= CONVERGED {
            return verify(f, g, h, iterate.x, steps);
        }
    }
    RiccatiOutcome::Unresolved { steps: DOUBLING_LIMIT, error: change }
}

struct Iterate {
    f: Mat,
    g: Mat,
    x: Mat,
}

impl Iterate {
    /// One doubling; returns the relative change of x.
    fn double(&mut self) -> f64 {
        let n = self.f.nrows();
        // Matrices of different sizes are in no equation, so they have no solution.
        let Ok(right) = linalg::hstack(&[&self.f, &self.g]) else { return f64::NAN };
        let solved = linalg::solve(&identity_plus(&self.g, &self.x), &right);
        let (wf, wg) = (solved.columns(0, n), solved.columns(n, n));
        let dx = linalg::symmetric_part(&(self.f.transpose() * (&self.x * wf)));
        let dg = linalg::symmetric_part(&(&self.f * wg * self.f.transpose()));
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

fn verify(f: &Mat, g: &Mat, h: &Mat, x: Mat, steps: usize) -> RiccatiOutcome {
    let (x, residual) = refined(f, g, h, x);
    let closed_loop = linalg::solve(&identity_plus(g, &x), f);
    let stable = linalg::spectral_radius(&closed_loop).is_ok_and(|radius| radius < 1.0);
    if residual <= RESIDUAL_LIMIT * x.norm() && stable {
        return RiccatiOutcome::Solved(RiccatiSolution { x, closed_loop, steps, residual });
    }
    RiccatiOutcome::Unresolved { steps, error: residual }
}

/// A few steps of the plain recursion, which contracts about its stabilising solution, as long as they help.
/// Returns the solution and its residual.
fn refined(f: &Mat, g: &Mat, h: &Mat, x: Mat) -> (Mat, f64) {
    let step = |weight: Mat| linalg::symmetric_part(&(f.transpose() * weight * f + h));
    let gap = |a: &Mat, b: &Mat| Some((a - b).norm()).filter(|gap| gap.is_finite()).unwrap_or(f64::INFINITY);
    let (plain, inverse) = (step(plain_weight(g, &x)), step(inverse_weight(g, &x)));
    let by_inverse = gap(&inverse, &x) < gap(&plain, &x);
    let (mut best, mut next) = (x, if by_inverse { inverse } else { plain });
    let mut residual = gap(&next, &best);
    for _ in 0..REFINEMENT_LIMIT {
        let after = step(if by_inverse { inverse_weight(g, &next) } else { plain_weight(g, &next) });
        let change = gap(&after, &next);
        if change >= residual {
            break;
        }
        (best, next, residual) = (next, after, change);
    }
    (best, residual)
}

/// X (I + G X)^-1.
fn plain_weight(g: &Mat, x: &Mat) -> Mat {
    x * linalg::inverse(&identity_plus(g, x))
}

/// (X^-1 + G)^-1, the same for an invertible X. It loses no digits where X is almost infinite.
fn inverse_weight(g: &Mat, x: &Mat) -> Mat {
    linalg::inverse(&(linalg::inverse(x) + g))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solved(f: &Mat, g: &Mat, h: &Mat) -> RiccatiSolution {
        match solve_doubling(f, g, h) {
            RiccatiOutcome::Solved(solution) => solution,
            RiccatiOutcome::Unresolved { steps, error } => panic!("unresolved after {steps}: {error}"),
        }
    }

    #[test]
    fn scalar_equation_has_its_quadratic_root() {
        // x = f^2 x / (1 + g x) + h, i.e. g x^2 + (1 - f^2 - g h) x - h = 0.
        for (f, g, h) in
            [(0.9_f64, 1.0, 1.0), (1.7, 2.0, 0.3), (0.5, -0.1, 1.0), (0.99, 1e-6, 1e3), (40.0, 1.0, 1e-9)]
        {
            let scalar = |x| Mat::from_element(1, 1, x);
            let x = solved(&scalar(f), &scalar(g), &scalar(h)).x[0];
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
        let x = solved(&f, &g, &h).x;
        let mut plain = Mat::zeros(n, n);
        for _ in 0..2000 {
            plain = f.transpose() * &plain * linalg::solve(&identity_plus(&g, &plain), &f) + &h;
        }
        assert!((&x - &plain).norm() < 1e-10 * plain.norm());
    }

    #[test]
    fn delay_lines_are_exact() {
        let n = 7;
        let f = Mat::from_fn(n, n, |i, j| f64::from(u8::from(j == i + 1)));
        let mut h = Mat::zeros(n, n);
        h[(n - 1, n - 1)] = 1.0;
        let x = solved(&f.transpose(), &Mat::zeros(n, n), &h).x;
        assert!((x - Mat::identity(n, n)).norm() < 1e-15);
    }

    #[test]
    fn no_stabilising_solution_is_said() {
        // Unit-circle eigenvalues: x = x / (1 - x) + 1 has no real root.
        let one = Mat::from_element(1, 1, 1.0);
        assert!(matches!(solve_doubling(&one, &-&one, &one), RiccatiOutcome::Unresolved { .. }));
    }
}
