//! What the interior-point methods tolerate.

/// What the interior-point methods tolerate.
pub(super) struct Settings {
    /// Largest fraction of the way to the boundary of the cone that a step goes: on the boundary the next
    /// Newton matrix is singular.
    pub(super) step_fraction: f64,
    /// A gap below this share of the least one so far is progress. A good step divides it by ten, a poor
    /// one changes it little.
    pub(super) progress_share: f64,
    /// Steps shorter than this part of a Newton step make no progress: millions of them would be needed.
    pub(super) shortest_step: f64,
    /// Duality gap that counts as zero, relative to the size of the data, the largest `sigma_max(W_l)`: a
    /// few hundred roundings.
    pub(super) gap_of_zero: f64,
    /// Combinations of unknowns whose effect is below this, relative to the largest, are dropped in the
    /// least-squares start: it needs no digit of them, and they would be huge.
    pub(super) rank_tolerance: f64,
    /// First shift tried if a Newton matrix is not positive definite: a few roundings of its unit diagonal.
    pub(super) shift_first: f64,
    /// Growth from one shift to the next: nine trials to the last.
    pub(super) shift_growth: f64,
    /// Largest shift. With a larger one the direction would be that of another matrix.
    pub(super) shift_last: f64,
    /// Singular values below this, relative to the largest, count as zero: thousands of roundings.
    pub(super) injective: f64,
    /// Singular values of the row-normalised channels below this are rounding errors; their directions are
    /// dropped.
    pub(super) channel_rank: f64,
    /// Where the data do not confine the taps: up to this many times the size of the solution (or of unit
    /// gain) they are covered by the bound.
    pub(super) radius_factor: f64,
    /// An estimate of the rounding errors of a sum beside its length, in units of the machine precision:
    /// products, phases, singular values. It keeps bounds of rounding errors alone from being taken for
    /// bounds.
    pub(super) rounding_per_operation: f64,
    /// The start lies this factor above the worst point of the least-squares taps (in t), far enough inside
    /// for the first Newton step.
    pub(super) start_margin: f64,
    /// Start of the mean-square iteration: its gap relative to the objective. Near enough to the end, far
    /// enough from the boundary.
    pub(super) starting_gap: f64,
    /// The share of the way to the cap that taps go which must not end beyond it: the rest is far more than
    /// the rounding of a gain, and costs a thousandth of the improvement.
    pub(super) way_to_cap: f64,
}

/// Of every problem.
pub(super) const SETTINGS: Settings = Settings {
    step_fraction: 0.98,
    progress_share: 0.9,
    shortest_step: 1e-7,
    gap_of_zero: 1e-13,
    rank_tolerance: 1e-11,
    shift_first: 1e-15,
    shift_growth: 10.0,
    shift_last: 1e-6,
    injective: 1e-12,
    channel_rank: 1e-14,
    radius_factor: 1e3,
    rounding_per_operation: 16.0,
    start_margin: 2.0,
    starting_gap: 0.1,
    way_to_cap: 0.999,
};
