//! The secondary objective: the least weighted mean square, with the noise of the channels, free or under a
//! cap on the worst case.
//!
//! Taps of least worst case are usually not unique. Among the taps within a small margin of the optimum,
//! those of least mean square have small errors at all frequencies.

use super::basis::Basis;
use super::interior::{InteriorIterate, Objective};
use super::prepare::Reduced;
use super::problem::{FrequencyPoint, MeanSquareObjective, SampledProblem};
use super::quadratic::Quadratic;
use crate::lmi::IsDue;
use crate::lmi::factor::RegularisedCholesky;
use crate::lmi::iteration::{self, Iterate};
use crate::lmi::settings::SETTINGS;
use crate::lti::FirMatrix;
use hybank_linalg::LinalgError;

/// Taps of least mean square under a cap.
#[derive(Debug, Clone)]
pub struct CappedMeanSquare {
    /// `F_j`, M x N for each lag.
    pub taps: FirMatrix,
    /// The secondary objective of these taps.
    pub mean_square: f64,
    /// Lower bound on it for any taps under the cap, from the dual iterate (valid up to rounding).
    pub lower: f64,
    /// Worst `sigma_max(K_l)` of these taps over the points; not above the cap.
    pub gamma: f64,
    /// Number of steps.
    pub iterations: usize,
}

/// Taps that minimise the secondary objective, by a QR factorisation (never by normal equations); least norm
/// among directions weaker than `tol_rank` times the strongest.
pub(crate) fn least_squares(
    problem: &SampledProblem,
    square: &MeanSquareObjective,
    tol_rank: f64,
) -> Result<FirMatrix, LinalgError> {
    let reduced = Reduced::new(problem)?;
    if reduced.layout.unknowns() == 0 {
        return Ok(problem.zero_taps());
    }
    let roots = |powers: &[f64]| powers.iter().map(|power| power.sqrt()).collect::<Vec<f64>>();
    let basis = Basis::new(&reduced, roots(&square.weights), &roots(&square.noise))?;
    Ok(reduced.taps(&basis.least_squares(&reduced, &reduced.w, tol_rank)))
}

/// Minimises the secondary objective subject to `sigma_max(K_l) <= cap` at every point, to a relative
/// duality gap; `None` if the start does not satisfy the cap strictly.
///
/// The usual start are the taps of [`super::minimise`] with a cap a little above
/// their gamma. If the unconstrained least-squares taps satisfy the cap they are returned at once.
/// The result is never worse than the start, and satisfies the cap, however the iteration ended; when
/// the end `is_due`, it is the best so far.
pub fn mean_square_under_cap(
    problem: &SampledProblem,
    square: &MeanSquareObjective,
    cap: f64,
    start: &FirMatrix,
    tol_gap_rel: f64,
    is_due: IsDue<'_>,
) -> Result<Option<CappedMeanSquare>, LinalgError> {
    let free = least_squares(problem, square, SETTINGS.rank_tolerance)?;
    let free_square = problem.mean_square(&free, square);
    let mut best = BestCapped::new(problem, square, cap, start)?;
    best.offer(free)?;
    if best.mean_square == free_square {
        return Ok(Some(best.finish(free_square, 0)));
    }
    if best.gamma >= cap {
        return Ok(None);
    }
    // From the start, in units of the cap and of the start's own mean square.
    let unit = best.mean_square / (cap * cap);
    let mut reduced = Reduced::new(&residual_problem(problem, start))?;
    reduced.rescale(cap);
    let quadratic = Quadratic::new(&reduced, square, start, cap, unit);
    let zero = vec![0.0; reduced.layout.unknowns()];
    let curvature = RegularisedCholesky::new(quadratic.curvature(&reduced));
    let engine = InteriorIterate::new(&reduced, Objective::MeanSquare(quadratic), zero, 1.0, is_due);
    let (Some(engine), Ok(curvature)) = (engine, curvature) else {
        return Ok(Some(best.finish(free_square, 0)));
    };
    let mut run = CappedIteration { engine, curvature };
    let (_, iterations) = iteration::run(&mut run, tol_gap_rel, is_due)?;
    let step = reduced.taps(&run.engine.x);
    let found = start.lags().iter().zip(step.lags()).map(|(f, d)| f + d * cap).collect();
    best.offer(best.within_cap(found)?)?;
    let lower = (best.mean_square - run.duality_gap() * (unit * cap * cap)).max(free_square);
    Ok(Some(best.finish(lower, iterations)))
}

/// The problem with the error of `start` as its reference.
fn residual_problem(problem: &SampledProblem, start: &FirMatrix) -> SampledProblem {
    let point = |l: usize| {
        let p = &problem.points()[l];
        FrequencyPoint { omega: p.omega, w: problem.error_at(l, start), h: p.h.clone() }
    };
    SampledProblem::new((0..problem.points().len()).map(point).collect(), problem.lags().to_vec())
}

struct BestCapped<'a> {
    problem: &'a SampledProblem,
    square: &'a MeanSquareObjective,
    cap: f64,
    taps: FirMatrix,
    mean_square: f64,
    gamma: f64,
}

impl<'a> BestCapped<'a> {
    fn new(
        problem: &'a SampledProblem,
        square: &'a MeanSquareObjective,
        cap: f64,
        start: &FirMatrix,
    ) -> Result<Self, LinalgError> {
        let gamma = problem.worst(start)?;
        let mean_square = problem.mean_square(start, square);
        Ok(Self { problem, square, cap, taps: start.clone(), mean_square, gamma })
    }

    /// Takes the taps if they respect the cap and improve.
    fn offer(&mut self, taps: FirMatrix) -> Result<(), LinalgError> {
        let mean_square = self.problem.mean_square(&taps, self.square);
        let gamma = self.problem.worst(&taps)?;
        if gamma <= self.cap && (mean_square < self.mean_square || self.gamma > self.cap) {
            (self.taps, self.mean_square, self.gamma) = (taps, mean_square, gamma);
        }
        Ok(())
    }

    /// The taps, or, if rounding has put them beyond the cap, ones on the way to them from the best so far.
    /// Gamma and the objective are convex, so what lies between is under the cap and an improvement.
    fn within_cap(&self, taps: FirMatrix) -> Result<FirMatrix, LinalgError> {
        let gamma = self.problem.worst(&taps)?;
        if gamma <= self.cap || self.gamma >= self.cap {
            return Ok(taps);
        }
        let share = SETTINGS.way_to_cap * (self.cap - self.gamma) / (gamma - self.gamma);
        Ok(self.taps.lags().iter().zip(taps.lags()).map(|(own, taps)| own + (taps - own) * share).collect())
    }

    fn finish(self, lower: f64, iterations: usize) -> CappedMeanSquare {
        let Self { taps, mean_square, gamma, .. } = self;
        CappedMeanSquare { taps, mean_square, lower: lower.min(mean_square), gamma, iterations }
    }
}

struct CappedIteration<'a> {
    engine: InteriorIterate<'a>,
    /// Q, the second derivative of the objective.
    curvature: RegularisedCholesky,
}

impl CappedIteration<'_> {
    /// `<S, Z> + r' Q^{-1} r / 2` with the dual residual r: how far the Lagrangian's minimum lies below the
    /// objective, whether or not the dual equality holds.
    fn duality_gap(&self) -> f64 {
        let r = self.engine.dual_residual();
        let correction: f64 = self.curvature.solve(&r).iter().zip(&r).map(|(a, b)| a * b).sum();
        self.engine.cone.gap() + 0.5 * correction.max(0.0)
    }
}

impl Iterate for CappedIteration<'_> {
    fn gap(&mut self) -> f64 {
        self.duality_gap() / self.engine.value().max(f64::MIN_POSITIVE)
    }

    fn judged_gap(&mut self) -> Result<f64, LinalgError> {
        Ok(self.gap())
    }

    fn step(&mut self) -> Option<()> {
        self.engine.step()
    }
}
