//! Settings of the interior-point methods.

/// A setting is out of its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("setting {name} = {value} must lie strictly between 0 and {most}")]
pub struct SettingError {
    /// Name of the setting.
    pub name: &'static str,
    /// Value given.
    pub value: f64,
    /// Exclusive upper limit.
    pub most: f64,
}

/// Limits and tolerances of an interior-point method. The defaults in brackets are those of
/// [`sampled`](super::sampled) and of [`kyp`](super::kyp).
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Maximum number of predictor-corrector steps (80).
    pub max_iterations: usize,
    /// Duality gap at which the iteration ends, relative to gamma (1e-9; 1e-7 for `kyp`, where rounding
    /// errors in the Newton matrix end the progress near 1e-9).
    pub tol_gap_rel: f64,
    /// Duality gap that counts as zero, relative to the size of the data: the largest `sigma_max(W_l)`, or
    /// the norm of the matrices for `kyp` (1e-13).
    pub tol_gap_abs: f64,
    /// Relative duality gap up to which a stalled run still counts as solved (1e-5).
    pub tol_gap_reduced: f64,
    /// Combinations of unknowns, and for `kyp` states, whose effect is below this, relative to the largest,
    /// are dropped; `sampled` drops them in its least-squares start only (1e-11; 1e-12 for `kyp`).
    pub tol_rank: f64,
    /// Largest fraction of the way to the boundary of the cone that a step goes (0.98).
    pub step_fraction: f64,
}

impl Settings {
    /// The defaults of [`sampled`](super::sampled).
    pub const SAMPLED: Self = Self {
        max_iterations: 80,
        tol_gap_rel: 1e-9,
        tol_gap_abs: 1e-13,
        tol_gap_reduced: 1e-5,
        tol_rank: 1e-11,
        step_fraction: 0.98,
    };

    /// The defaults of [`kyp`](super::kyp).
    pub const KYP: Self = Self { tol_gap_rel: 1e-7, tol_rank: 1e-12, ..Self::SAMPLED };

    /// Refuses tolerances and step fractions outside of (0, 1).
    pub(super) fn check(&self) -> Result<(), SettingError> {
        let fractions = [
            ("tol_gap_rel", self.tol_gap_rel),
            ("tol_gap_abs", self.tol_gap_abs),
            ("tol_gap_reduced", self.tol_gap_reduced),
            ("tol_rank", self.tol_rank),
            ("step_fraction", self.step_fraction),
        ];
        match fractions.into_iter().find(|(_, value)| !(*value > 0.0 && *value < 1.0)) {
            Some((name, value)) => Err(SettingError { name, value, most: 1.0 }),
            None => Ok(()),
        }
    }
}
