//! The bounded real lemma with outputs affine in the unknowns (the LMI of thesis 5.4).
//!
//! For a fixed stable (A, B) and `C(x) = C_0 + sum_k x_k C_k`, `D(x) = D_0 + sum_k x_k D_k`, minimise gamma
//! such that some symmetric P satisfies
//!
//! ```text
//! [ P - A'PA   -A'PB            C(x)'   ]
//! [ -B'PA      gamma I - B'PB   D(x)'   ]  >= 0,
//! [ C(x)       D(x)             gamma I ]
//! ```
//!
//! which says that `C(x) (zI - A)^-1 B + D(x)` has an H-infinity norm of at most gamma. The
//! dual variable is the covariance `Z = [Zxx Zxu *; Zux Zuu *; Zyx Zyu Zyy]` of states, inputs and outputs:
//!
//! ```text
//! maximise -2 <[Zyx Zyu], [C_0 D_0]>
//! subject to  Zxx = A Zxx A' + A Zxu B' + B Zxu' A' + B Zuu B',   <[Zyx Zyu], [C_k D_k]> = 0,
//!             tr Zuu + tr Zyy = 1,   Z >= 0.
//! ```
//!
//! The Lyapunov equality determines Zxx, so the unknowns of the Newton system are `Zxu, Zuu, Zyx, Zyu, Zyy`
//! and x. The n(n+1)/2 entries of P are not among them; they follow from a Lyapunov equation. Both sides are
//! feasible in all iterations: the dual starts from any `Zuu > 0` with its Gramian, the primal from a
//! Lyapunov matrix and a large gamma.
//!
//! Sources: Vandenberghe, Balakrishnan, Wallin, Hansson, Roh, "Interior-point algorithms for
//! semidefinite programming problems derived from the KYP lemma", in *Positive polynomials in
//! control*, 2005 (the elimination); Helmberg et al. 1996 and Kojima et al. 1997 (the
//! direction, here in its dual form).

mod covariance;
mod problem;
mod solver;
#[cfg(test)]
mod tests;

pub use problem::Problem;
pub use solver::{Solution, minimise};
