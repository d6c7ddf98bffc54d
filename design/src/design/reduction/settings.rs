//! What order reduction takes for rounding.

/// What order reduction takes for rounding.
pub(super) struct Settings {
    /// States below this share of the output are rounding errors of the Gramians.
    pub(super) rounding_share: f64,
    /// Directions of the regressors below this share of the strongest are rounding errors.
    pub(super) rank_tolerance: f64,
    /// Frequencies closer than this are one, in radians: the rows of two would be equal up to rounding.
    pub(super) least_distance: f64,
    /// Losses below this are rounding errors, in decibels: ten times the accuracy of gamma.
    pub(super) rounding_db: f64,
    /// Errors below this fraction of the plant's gain count as zero: what is left of a difference of
    /// doubles.
    pub(super) zero_error: f64,
}

/// Of every reduction.
pub(super) const SETTINGS: Settings = Settings {
    rounding_share: 1e-12,
    rank_tolerance: 1e-12,
    least_distance: 1e-9,
    rounding_db: 5e-5,
    zero_error: 1e-12,
};
