//! What the interior-point methods share: their loop and their step rule.

use super::settings::SETTINGS;
use hybank_linalg::LinalgError;

/// Relative duality gap that is as small as rounding errors allow.
pub const FINEST_GAP: f64 = 1e-9;

/// Maximum number of predictor-corrector steps.
const MOST_STEPS: usize = 80;
/// Steps without progress after which an iteration has stalled. The gap of a hard problem does not shrink in
/// every step.
const PATIENCE: usize = 6;
/// Bounds of Mehrotra's centering: a step always aims inside of the cone, and always lowers the gap.
const CENTERING: [f64; 2] = [1e-8, 0.9];

/// Lengths of a step, in parts of a Newton step.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepLengths {
    pub(super) primal: f64,
    pub(super) dual: f64,
}

impl StepLengths {
    /// Whether such a step moves the iterate.
    pub(super) fn make_progress(self) -> bool {
        !self.primal.is_nan() && !self.dual.is_nan() && self.primal.max(self.dual) >= SETTINGS.shortest_step
    }
}

/// The fraction of the way to the boundary that a step goes: the closer, the longer the steps of the
/// predictor were (Mehrotra).
pub(super) fn fraction(predicted: StepLengths) -> f64 {
    SETTINGS.step_fraction.min(0.9 + 0.09 * predicted.primal.min(predicted.dual).min(1.0))
}

/// Mehrotra's centering, from the ratio of the gap that the predictor leaves to the present one.
pub(super) fn centering(ratio: f64) -> f64 {
    ratio.clamp(0.0, 1.0).powi(3).clamp(CENTERING[0], CENTERING[1])
}

/// Whether the caller wants the iteration to end with what it has. Once due, it stays due.
pub type IsDue<'a> = &'a dyn Fn() -> bool;

/// A primal-dual iterate, as the loop sees it.
pub(super) trait Iterate {
    /// The relative duality gap of the iterate, or a cheap estimate of it.
    fn gap(&mut self) -> f64;

    /// The relative duality gap of the best solution, this iterate included. It is asked for when the
    /// estimate is within the tolerance, and at the end.
    fn judged_gap(&mut self) -> Result<f64, LinalgError>;

    /// Makes one predictor-corrector step; `None` if rounding errors prevent it or the caller ends it.
    fn step(&mut self) -> Option<()>;
}

/// Iterates until the relative gap is within its tolerance, the progress ends, the limit is reached or
/// the end `is_due`. Returns whether the gap is within the tolerance, and the number of steps. An iterate
/// whose end is due is not judged: that takes as long as several steps.
pub(super) fn run(
    iterate: &mut impl Iterate,
    tol_gap_rel: f64,
    is_due: IsDue<'_>,
) -> Result<(bool, usize), LinalgError> {
    let (mut least, mut waited, mut steps) = (f64::INFINITY, 0, 0);
    while steps < MOST_STEPS && !is_due() {
        let gap = iterate.gap();
        if gap <= tol_gap_rel && iterate.judged_gap()? <= tol_gap_rel {
            return Ok((true, steps));
        }
        waited = if gap < SETTINGS.progress_share * least { 0 } else { waited + 1 };
        least = least.min(gap);
        if waited > PATIENCE || iterate.step().is_none() {
            break;
        }
        steps += 1;
    }
    Ok((!is_due() && iterate.judged_gap()? <= tol_gap_rel, steps))
}
