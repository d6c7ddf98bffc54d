//! What the search for integer taps tolerates.

/// What the search for integer taps tolerates.
pub(super) struct Settings {
    /// Fraction of the weights that a round replaces: with all of them the worst frequency would jump to
    /// and fro.
    pub(super) replaced_share: f64,
    /// Weight of the worst frequency, relative to the uniform weights of the start: it counts more than the
    /// others and does not decide alone.
    pub(super) emphasis: f64,
    /// Relative excess over the gamma of the real taps that counts as none: 0.0002 dB.
    pub(super) negligible_loss: f64,
    /// Fraction of the excess over gamma of the real taps that a move must remove. Smaller gains cost many
    /// evaluations each.
    pub(super) least_excess_removed: f64,
    /// Relative difference of gamma below which the mean square decides: 0.001 dB.
    pub(super) gamma_tie: f64,
    /// Integers that lower the gamma of zero output by less than this share do no better than zero output.
    pub(super) least_effect_of_integers: f64,
    /// Real taps that lower it by more than this share have an effect, which integers should have too.
    pub(super) least_effect_of_real_taps: f64,
    /// Mean squares below this, relative to that of zero taps, are zero up to rounding: the square of an
    /// error of 1e-10.
    pub(super) zero_mean_square: f64,
    /// Share of the gamma of zero output below which gamma is rounding of the sums of target and filters.
    pub(super) zero_gamma: f64,
    /// Added to the diagonal, because the form is singular for equal channels. Relative to each entry,
    /// because channels may differ by many decades.
    pub(super) ridge: f64,
}

/// Of every search.
pub(super) const SETTINGS: Settings = Settings {
    replaced_share: 0.2,
    emphasis: 3.0,
    negligible_loss: 2e-5,
    least_excess_removed: 0.02,
    gamma_tie: 1e-4,
    least_effect_of_integers: 1e-6,
    least_effect_of_real_taps: 1e-3,
    zero_mean_square: 1e-20,
    zero_gamma: 4.0 * f64::EPSILON,
    ridge: 1e-12,
};
