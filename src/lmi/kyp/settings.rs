//! Settings of the KYP solver.

use crate::lmi::settings::{SettingError, check_settings};

/// Limits and tolerances of the KYP solver.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Maximum number of predictor-corrector steps (default 80).
    pub max_iterations: usize,
    /// Duality gap at which the iteration ends, relative to gamma (default 1e-7). Rounding errors in the
    /// Newton matrix end the progress near 1e-9.
    pub tol_gap_rel: f64,
    /// Duality gap that counts as zero, relative to the norm of the data (default 1e-13).
    pub tol_gap_abs: f64,
    /// Relative duality gap up to which a stalled run still counts as solved (default 1e-5).
    pub tol_gap_reduced: f64,
    /// States and combinations of unknowns below this, relative to the largest, are dropped (default 1e-12).
    pub tol_rank: f64,
    /// Largest fraction of the way to the boundary of the cone that a step goes (default 0.98).
    pub step_fraction: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_iterations: 80,
            tol_gap_rel: 1e-7,
            tol_gap_abs: 1e-13,
            tol_gap_reduced: 1e-5,
            tol_rank: 1e-12,
            step_fraction: 0.98,
        }
    }
}

impl Settings {
    pub(super) fn check(&self) -> Result<(), SettingError> {
        check_settings(&[
            ("tol_gap_rel", self.tol_gap_rel),
            ("tol_gap_abs", self.tol_gap_abs),
            ("tol_gap_reduced", self.tol_gap_reduced),
            ("tol_rank", self.tol_rank),
            ("step_fraction", self.step_fraction),
        ])
    }
}
