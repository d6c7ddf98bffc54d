//! A general-purpose solver for linear matrix inequalities.
//!
//! ```text
//! minimise c'x  subject to  F_k(x) = F0_k + sum_i x_i F_ik >= 0,  g_k + G_k x >= 0,  A x = b
//! ```
//!
//! with symmetric blocks whose coefficients are dense, sparse or of low rank. Its dual is
//!
//! ```text
//! maximise -sum_k <F0_k, Z_k> + b'lambda  subject to  sum_k <F_ik, Z_k> + (A'lambda)_i = c_i,  Z_k >= 0.
//! ```
//!
//! The method is a predictor-corrector iteration on the homogeneous self-dual embedding in the HKM
//! direction: it needs no starting point, and it ends with a solution of both problems or with a
//! certificate that one of them has none.
//!
//! Sources: Ye, Todd, Mizuno, Math. Oper. Res. 19 (1994) and Potra, Sheng, SIAM J. Optim. 8 (1998) for
//! the embedding; Helmberg, Rendl, Vanderbei, Wolkowicz, SIAM J. Optim. 6 (1996) for the direction;
//! Fujisawa, Kojima, Nakata, Math. Programming 79 (1997) for forming the Newton matrix from sparse
//! data; Ruiz, RAL-TR-2001-034, for the equilibration.

mod coefficient;
mod cone;
mod equilibrate;
mod newton;
mod problem;
mod solver;
#[cfg(test)]
mod tests;

pub use coefficient::Coefficient;
pub use problem::{GeneralError, Problem};
pub use solver::{Residuals, minimise};

use super::{SettingError, check_settings};
use crate::linalg::Mat;

/// Limits and tolerances of the general solver.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Most predictor-corrector steps (default 100).
    pub max_iterations: usize,
    /// Primal and dual residual, relative to the data (default 1e-9).
    pub tol_feasibility: f64,
    /// Duality gap, absolute (default 1e-9).
    pub tol_gap_abs: f64,
    /// Duality gap, relative to the objective (default 1e-9).
    pub tol_gap_rel: f64,
    /// Residual of a certificate, relative to its own objective (default 1e-9).
    pub tol_infeasible: f64,
    /// All the above for a run that stalls to count as solved (default 1e-5).
    pub tol_reduced: f64,
    /// Largest fraction of the way to the boundary of the cone that a step goes (default 0.98).
    pub step_fraction: f64,
    /// Rounds of equilibration; 0 switches it off (default 8).
    pub equilibrate_rounds: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            tol_feasibility: 1e-9,
            tol_gap_abs: 1e-9,
            tol_gap_rel: 1e-9,
            tol_infeasible: 1e-9,
            tol_reduced: 1e-5,
            step_fraction: 0.98,
            equilibrate_rounds: 8,
        }
    }
}

impl Settings {
    fn check(&self) -> Result<(), SettingError> {
        check_settings(&[
            ("tol_feasibility", self.tol_feasibility),
            ("tol_gap_abs", self.tol_gap_abs),
            ("tol_gap_rel", self.tol_gap_rel),
            ("tol_infeasible", self.tol_infeasible),
            ("tol_reduced", self.tol_reduced),
            ("step_fraction", self.step_fraction),
        ])
    }
}

/// Dual variables: a symmetric matrix a matrix inequality, a vector a set of linear inequalities, in
/// the order the inequalities were added, and multipliers of the equalities.
#[derive(Debug, Clone, PartialEq)]
pub struct Dual {
    /// `Z_k >= 0`.
    pub matrices: Vec<Mat>,
    /// `z_k >= 0`.
    pub vectors: Vec<Vec<f64>>,
    /// `lambda`.
    pub equalities: Vec<f64>,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Optimal to the tolerances.
    Solved,
    /// No further progress; optimal to the reduced tolerance.
    SolvedInaccurate,
    /// No x satisfies the inequalities. The certificate has `Z >= 0`,
    /// `sum_k <F_ik, Z_k> + (A'lambda)_i = 0` and `sum_k <F0_k, Z_k> - b'lambda = -1`.
    PrimalInfeasible {
        /// The certificate.
        certificate: Dual,
    },
    /// The dual has no point: the objective falls without bound along x wherever the inequalities can be satisfied. The certificate
    /// has `sum_i x_i F_ik >= 0`, `A x = 0` and `c'x = -1`.
    DualInfeasible {
        /// The certificate.
        certificate: Vec<f64>,
    },
    /// The iteration limit came first.
    IterationLimit,
    /// Rounding errors ended the progress.
    NumericalTrouble,
}

/// The best iterate with what is known about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// How the run ended.
    pub outcome: Outcome,
    /// The unknowns.
    pub x: Vec<f64>,
    /// `c'x`.
    pub objective: f64,
    /// Dual variables.
    pub dual: Dual,
    /// `-<F0, Z> + b'lambda`: a lower bound on the optimum as far as the dual residual is zero.
    pub dual_objective: f64,
    /// Residuals and gap, in the units of the data.
    pub residuals: Residuals,
    /// Predictor-corrector steps made.
    pub iterations: usize,
}
