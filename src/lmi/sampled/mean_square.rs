//! The secondary objective: the least weighted mean square, with the noise of the channels, free or under a
//! cap on the worst case.
//!
//! Taps of least worst case are usually not unique. Among the taps within a small margin of the optimum,
//! those of least mean square have small errors at all frequencies.

use super::basis::Basis;
use super::interior::{Engine, Objective};
use super::prepare::Reduced;
use super::problem::{MeanSquareObjective, Point, Problem, SampledError, Taps};
use super::quadratic::Quadratic;
use super::step::Step;
use crate::lmi::Settings;
use crate::lmi::factor::RegularisedCholesky;
use crate::lmi::outcome::Outcome;

/// Steps without a smaller gap after which the iteration ends.
const PATIENCE: usize = 6;

/// Taps of least mean square under a cap.
#[derive(Debug, Clone)]
pub struct MeanSquare {
    /// Why the iteration ended.
    pub outcome: Outcome,
    /// `F_j`, M x N for each lag.
    pub taps: Taps,
    /// The secondary objective of these taps.
    pub mean_square: f64,
    /// Lower bound on it for any taps under the cap, from the dual iterate (valid up to rounding).
    pub lower: f64,
    /// Worst `sigma_max(K_l)` of these taps over the points; not above the cap.
    pub gamma: f64,
    /// Index of the point where it is attained.
    pub worst_point: usize,
    /// Iteration record; the objective is relative to the start's.
    pub steps: Vec<Step>,
}

/// Taps that minimise the secondary objective, by a QR factorisation (never by normal equations); least norm
/// among directions weaker than `tol_rank` times the strongest.
///
/// Fails if weights or noise do not fit: see [`MeanSquareObjective`].
pub fn least_squares(
    problem: &Problem,
    square: &MeanSquareObjective,
    tol_rank: f64,
) -> Result<Taps, SampledError> {
    problem.check_objective(square)?;
    let reduced = Reduced::new(problem)?;
    if reduced.layout.unknowns() == 0 {
        return Ok(problem.zero_taps());
    }
    let roots = |powers: &[f64]| powers.iter().map(|power| power.sqrt()).collect::<Vec<f64>>();
    let basis = Basis::with_noise(&reduced, roots(&square.weights), &roots(&square.noise))?;
    Ok(reduced.taps(&basis.least_squares(&reduced, &reduced.w, tol_rank)))
}

/// Minimises the secondary objective subject to `sigma_max(K_l) <= cap` at every point.
///
/// `start` must satisfy the cap strictly: the taps of [`super::minimise`] with a cap a little above
/// their gamma. If the unconstrained least-squares taps satisfy the cap they are returned at once.
/// The result is never worse than the start, and satisfies the cap, however the iteration ended.
pub fn mean_square_under_cap(
    problem: &Problem,
    square: &MeanSquareObjective,
    cap: f64,
    start: &Taps,
    settings: &Settings,
) -> Result<MeanSquare, SampledError> {
    settings.check()?;
    problem.check_taps(start)?;
    let free = least_squares(problem, square, settings.tol_rank)?;
    let free_square = problem.mean_square(&free, square);
    let mut best = Best::new(problem, square, cap, start)?;
    best.offer(free)?;
    if best.mean_square == free_square {
        return Ok(best.finish(Outcome::Solved, free_square, Vec::new()));
    }
    if best.gamma >= cap {
        return Err(SampledError::Cap { cap, gamma: best.gamma });
    }
    // From the start, in units of the cap and of the start's own mean square.
    let unit = best.mean_square / (cap * cap);
    let mut reduced = Reduced::new(&residual_problem(problem, start)?)?;
    reduced.rescale(cap);
    let quadratic = Quadratic::new(&reduced, square, start, cap, unit);
    let run = Run { reduced: &reduced, start, quadratic, cap, settings };
    let (outcome, gap, steps) = run.iterate(&mut best)?;
    let lower = (best.mean_square - gap * best.mean_square_unit(unit)).max(free_square);
    Ok(best.finish(outcome, lower, steps))
}

/// The problem with the error of `start` as its reference.
fn residual_problem(problem: &Problem, start: &Taps) -> Result<Problem, SampledError> {
    let point = |l: usize| {
        let p = &problem.points()[l];
        Point { omega: p.omega, w: problem.error_at(l, start), h: p.h.clone() }
    };
    Problem::new((0..problem.points().len()).map(point).collect(), problem.lags().to_vec())
}

struct Best<'a> {
    problem: &'a Problem,
    square: &'a MeanSquareObjective,
    cap: f64,
    taps: Taps,
    mean_square: f64,
    gamma: f64,
    worst_point: usize,
}

impl<'a> Best<'a> {
    fn new(
        problem: &'a Problem,
        square: &'a MeanSquareObjective,
        cap: f64,
        start: &Taps,
    ) -> Result<Self, SampledError> {
        let (gamma, worst_point) = problem.worst(start)?;
        let mean_square = problem.mean_square(start, square);
        Ok(Self { problem, square, cap, taps: start.clone(), mean_square, gamma, worst_point })
    }

    /// Takes the taps if they respect the cap and improve.
    fn offer(&mut self, taps: Taps) -> Result<(), SampledError> {
        let mean_square = self.problem.mean_square(&taps, self.square);
        let (gamma, worst_point) = self.problem.worst(&taps)?;
        if gamma <= self.cap && (mean_square < self.mean_square || self.gamma > self.cap) {
            (self.taps, self.mean_square) = (taps, mean_square);
            (self.gamma, self.worst_point) = (gamma, worst_point);
        }
        Ok(())
    }

    fn mean_square_unit(&self, unit: f64) -> f64 {
        unit * self.cap * self.cap
    }

    fn finish(self, outcome: Outcome, lower: f64, steps: Vec<Step>) -> MeanSquare {
        let Self { taps, mean_square, gamma, worst_point, .. } = self;
        MeanSquare { outcome, taps, mean_square, lower: lower.min(mean_square), gamma, worst_point, steps }
    }
}

struct Run<'a> {
    reduced: &'a Reduced,
    start: &'a Taps,
    quadratic: Quadratic,
    cap: f64,
    settings: &'a Settings,
}

impl Run<'_> {
    /// Returns the outcome, the gap in scaled units and the record.
    fn iterate(&self, best: &mut Best<'_>) -> Result<(Outcome, f64, Vec<Step>), SampledError> {
        let mut steps = Vec::new();
        let zero = vec![0.0; self.reduced.layout.unknowns()];
        let objective = Objective::MeanSquare(self.quadratic.clone());
        let Some(mut engine) = Engine::new(self.reduced, objective, zero, 1.0) else {
            return Ok((Outcome::NumericalTrouble, f64::INFINITY, steps));
        };
        let Ok(curvature) = RegularisedCholesky::new(self.quadratic.curvature(self.reduced)) else {
            return Ok((Outcome::NumericalTrouble, f64::INFINITY, steps));
        };
        let (mut least, mut waited) = (f64::INFINITY, 0);
        while steps.len() < self.settings.max_iterations {
            let gap = duality_gap(&engine, &curvature) / engine.value().max(f64::MIN_POSITIVE);
            waited = if gap < 0.9 * least { 0 } else { waited + 1 };
            least = least.min(gap);
            if gap <= self.settings.tol_gap_rel || waited > PATIENCE {
                break;
            }
            match engine.step(self.settings) {
                Ok(step) => steps.push(step),
                Err(_) => break,
            }
        }
        let gap = duality_gap(&engine, &curvature);
        let relative = gap / engine.value().max(f64::MIN_POSITIVE);
        best.offer(self.taps(&engine.x))?;
        let limit_reached = steps.len() >= self.settings.max_iterations;
        let solved = [self.settings.tol_gap_rel, self.settings.tol_gap_reduced].map(|tol| relative <= tol);
        let outcome = Outcome::at_end(solved, limit_reached);
        Ok((outcome, gap, steps))
    }

    fn taps(&self, x: &[f64]) -> Taps {
        let step = self.reduced.taps(x);
        self.start.iter().zip(step).map(|(f, d)| f + d * self.cap).collect()
    }
}

/// `<S, Z> + r' Q^{-1} r / 2` with the dual residual r: how far the Lagrangian's minimum lies below
/// the objective, whether or not the dual equality holds.
fn duality_gap(engine: &Engine<'_>, curvature: &RegularisedCholesky) -> f64 {
    let r = engine.dual_residual();
    let correction: f64 = curvature.solve(r).iter().zip(r).map(|(a, b)| a * b).sum();
    engine.cone.gap() + 0.5 * correction.max(0.0)
}
