//! The sampled worst-case norm problem: the engine of FIR design.
//!
//! Over real taps `F_0 .. F_{J-1}` (each M x N) minimise
//!
//! ```text
//! gamma = max_l sigma_max(K_l),   K_l = W_l - sum_j e^{-i omega_l j} F_j H_l
//! ```
//!
//! with given complex `W_l` (M x q), `H_l` (N x q) at frequencies `omega_l`. Row p of the taps has
//! its own number of lags `J_p <= J`. Conjugate symmetry makes frequencies in `[0, pi]` enough for
//! real filters. Several scenarios that share the taps are simply more points.
//!
//! The method: an LQ factorisation at each point splits `K_l K_l* = (W1 - F H1)(W1 - F H1)* + G`
//! into the part the taps can reach and a constant; with `t = gamma^2` each point is one small LMI
//!
//! ```text
//! [ t I - G_l   K1_l ]
//! [ K1_l*       I    ]  >= 0,
//! ```
//!
//! solved by a primal-dual predictor-corrector iteration in the HKM direction. Its Newton matrix is
//! Toeplitz plus Hankel in the lags for each pair of taps, so it is summed at the cost of one
//! product per pair of rows. The data are shifted and scaled by the least-squares
//! solution first, which makes `t` of order one whatever the size of gamma. The dual iterate is then turned into
//! a lower bound that is proved from the original data alone ([`lower_bound`]).
//!
//! Sources: Vandenberghe and Boyd, "Semidefinite programming", SIAM Review 38 (1996); Helmberg,
//! Rendl, Vanderbei, Wolkowicz, SIAM J. Optim. 6 (1996), Kojima, Shindoh, Hara, SIAM J. Optim. 7
//! (1997) and Monteiro, SIAM J. Optim. 7 (1997) for the direction; Mehrotra, SIAM J. Optim. 2 (1992)
//! for the step.

mod basis;
mod blocks;
mod bound;
mod fourier;
mod interior;
mod mean_square;
mod newton;
mod prepare;
mod problem;
mod quadratic;
#[cfg(test)]
mod tests;
mod worst_case;

pub use bound::{Covered, LowerBound, lower_bound};
pub use mean_square::{MeanSquare, least_squares, mean_square_under_cap};
pub use problem::{Point, Problem, SampledError, Square, Taps};
pub use worst_case::{Solution, minimise};

use super::{SettingError, check_settings};

/// Limits and tolerances of the sampled solver.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Most predictor-corrector steps (default 80).
    pub max_iterations: usize,
    /// Wanted proven gap, relative to gamma (default 1e-9).
    pub tol_gap_rel: f64,
    /// Gap that is as good as none, relative to the largest `sigma_max(W_l)` (default 1e-13).
    pub tol_gap_abs: f64,
    /// Gap, relative to gamma, up to which a stalled run still counts as solved (default 1e-5).
    pub tol_gap_reduced: f64,
    /// Directions of tap space whose effect is smaller than this, relative to the strongest, are not
    /// used by the least-squares start (default 1e-11).
    pub tol_rank: f64,
    /// Largest fraction of the way to the boundary of the cone that a step goes (default 0.98).
    pub step_fraction: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_iterations: 80,
            tol_gap_rel: 1e-9,
            tol_gap_abs: 1e-13,
            tol_gap_reduced: 1e-5,
            tol_rank: 1e-11,
            step_fraction: 0.98,
        }
    }
}

impl Settings {
    pub(crate) fn check(&self) -> Result<(), SettingError> {
        check_settings(&[
            ("tol_gap_rel", self.tol_gap_rel),
            ("tol_gap_abs", self.tol_gap_abs),
            ("tol_gap_reduced", self.tol_gap_reduced),
            ("tol_rank", self.tol_rank),
            ("step_fraction", self.step_fraction),
        ])
    }
}

/// One line of the iteration record. The objective is in scaled units (`t` for the worst case, the
/// mean square for the second objective).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Objective at the start of the step.
    pub objective: f64,
    /// Mean complementarity, `sum <S_l, Z_l>` over the total order.
    pub mu: f64,
    /// Norm of the dual equality residual.
    pub dual_residual: f64,
    /// Step length of the taps.
    pub alpha_primal: f64,
    /// Step length of the dual matrices.
    pub alpha_dual: f64,
    /// Diagonal shift that the Newton matrix needed (0 nearly always).
    pub shift: f64,
}
