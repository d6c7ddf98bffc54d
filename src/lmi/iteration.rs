//! What the interior-point methods share: their settings, their loop, their step rule and their outcome.

use super::LmiError;

/// How an iteration ended. Bounds, residuals and iterates are returned beside it; a hard problem is not an
/// error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome {
    /// The duality gap is within the tolerance.
    Solved,
    /// No further progress, but the duality gap is within the reduced tolerance.
    SolvedInaccurate,
    /// The iteration limit was reached first; the best iterate and its bounds are returned.
    IterationLimit,
    /// Rounding errors stopped the progress; the best iterate and its bounds are returned.
    NumericalTrouble,
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
    /// A gap below this share of the least one so far is progress (0.9; 0.95 for `kyp`).
    pub progress: f64,
    /// Gap from which on the iteration never counts as stalled (infinity; 0.5 for `kyp`, whose first steps
    /// may go by without a useful bound).
    pub gap_without_stall: f64,
}

/// Steps without progress after which an iteration has stalled. The gap of a hard problem does not shrink in
/// every step.
const PATIENCE: usize = 6;
/// Steps shorter than this part of a Newton step make no progress.
const SHORTEST_STEP: f64 = 1e-7;
/// Bounds of Mehrotra's centering: a step always aims inside of the cone, and always lowers the gap.
const CENTERING: [f64; 2] = [1e-8, 0.9];

impl Settings {
    /// The defaults of [`sampled`](super::sampled).
    pub const SAMPLED: Self = Self {
        max_iterations: 80,
        tol_gap_rel: 1e-9,
        tol_gap_abs: 1e-13,
        tol_gap_reduced: 1e-5,
        tol_rank: 1e-11,
        step_fraction: 0.98,
        progress: 0.9,
        gap_without_stall: f64::INFINITY,
    };

    /// The defaults of [`kyp`](super::kyp).
    pub const KYP: Self =
        Self { tol_gap_rel: 1e-7, tol_rank: 1e-12, progress: 0.95, gap_without_stall: 0.5, ..Self::SAMPLED };

    /// Refuses tolerances and step fractions outside of (0, 1).
    pub(super) fn check(&self) -> Result<(), LmiError> {
        let fractions = [
            ("tol_gap_rel", self.tol_gap_rel),
            ("tol_gap_abs", self.tol_gap_abs),
            ("tol_gap_reduced", self.tol_gap_reduced),
            ("tol_rank", self.tol_rank),
            ("step_fraction", self.step_fraction),
            ("progress", self.progress),
        ];
        match fractions.into_iter().find(|(_, value)| !(*value > 0.0 && *value < 1.0)) {
            Some((name, value)) => Err(LmiError::Setting { name, value }),
            None => Ok(()),
        }
    }

    /// The fraction of the way to the boundary that a step goes: the closer, the longer the steps of the
    /// predictor were (Mehrotra).
    pub(super) fn fraction(&self, predicted: StepLengths) -> f64 {
        self.step_fraction.min(0.9 + 0.09 * predicted.primal.min(predicted.dual).min(1.0))
    }
}

/// Lengths of a step, in parts of a Newton step.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepLengths {
    pub(super) primal: f64,
    pub(super) dual: f64,
}

impl StepLengths {
    /// Whether such a step moves the iterate.
    pub(super) fn make_progress(self) -> bool {
        !self.primal.is_nan() && !self.dual.is_nan() && self.primal.max(self.dual) >= SHORTEST_STEP
    }
}

/// Mehrotra's centering, from the ratio of the gap that the predictor leaves to the present one.
pub(super) fn centering(ratio: f64) -> f64 {
    ratio.clamp(0.0, 1.0).powi(3).clamp(CENTERING[0], CENTERING[1])
}

/// A primal-dual iterate, as the loop sees it.
pub(super) trait Iterate {
    /// The relative duality gap of the iterate, or a cheap estimate of it.
    fn gap(&mut self) -> f64;

    /// The relative duality gap of the best solution, this iterate included. It is asked for when the
    /// estimate is within the tolerance, and at the end.
    fn judged_gap(&mut self) -> Result<f64, LmiError>;

    /// Makes one predictor-corrector step; `None` if rounding errors prevent it.
    fn step(&mut self, settings: &Settings) -> Option<()>;
}

/// Iterates until the gap is within its tolerance, the progress ends or the limit is reached. Returns the
/// outcome and the number of steps.
pub(super) fn run(iterate: &mut impl Iterate, settings: &Settings) -> Result<(Outcome, usize), LmiError> {
    let (mut least, mut waited, mut steps) = (f64::INFINITY, 0, 0);
    while steps < settings.max_iterations {
        let gap = iterate.gap();
        if gap <= settings.tol_gap_rel && iterate.judged_gap()? <= settings.tol_gap_rel {
            return Ok((Outcome::Solved, steps));
        }
        waited = if gap < settings.progress * least { 0 } else { waited + 1 };
        least = least.min(gap);
        let stalled = waited > PATIENCE && gap < settings.gap_without_stall;
        if stalled || iterate.step(settings).is_none() {
            break;
        }
        steps += 1;
    }
    let outcome = match iterate.judged_gap()? {
        gap if gap <= settings.tol_gap_rel => Outcome::Solved,
        gap if gap <= settings.tol_gap_reduced => Outcome::SolvedInaccurate,
        _ if steps >= settings.max_iterations => Outcome::IterationLimit,
        _ => Outcome::NumericalTrouble,
    };
    Ok((outcome, steps))
}
