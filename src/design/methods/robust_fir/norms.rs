//! What designs for a box of errors have in common.

use crate::design::DesignError;

/// Relative width of the interval of the worst norm over the scenarios.
pub(super) const ACCURACY: f64 = 1e-4;
/// Relative margin of that norm for the least mean square without errors.
pub(super) const MARGIN: f64 = 2e-4;

/// The norms of a bank, computed (h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct RobustNorms {
    /// Without errors.
    pub nominal: f64,
    /// The largest over the scenarios.
    pub worst: f64,
}

/// The largest of some norms.
pub(super) fn largest(
    mut values: impl Iterator<Item = Result<f64, DesignError>>,
) -> Result<f64, DesignError> {
    values.try_fold(0.0, |most, value| Ok(f64::max(most, value?)))
}

/// Lags of the output samples p of a slow period.
pub(super) fn lags(ratio: usize, taps: usize) -> Vec<usize> {
    (0..ratio).map(|p| taps.saturating_sub(p).div_ceil(ratio)).collect()
}
