//! Settings and iteration record of the sampled solver.

use crate::lmi::settings::{SettingError, check_settings};

/// Limits and tolerances of the sampled solver.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Most predictor-corrector steps (default 80).
    pub max_iterations: usize,
    /// Duality gap at which the iteration ends, relative to gamma (default 1e-9).
    pub tol_gap_rel: f64,
    /// Duality gap that counts as zero, relative to the largest `sigma_max(W_l)` (default 1e-13).
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
/// mean square for the secondary objective).
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
