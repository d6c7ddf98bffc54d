//! Taps of least worst-case norm over the points.

use super::basis::Basis;
use super::bound::{self, Covered, LowerBound};
use super::interior::{Engine, Objective, norm};
use super::prepare::Reduced;
use super::problem::{Problem, SampledError, Taps};
use super::step::Step;
use crate::linalg::{self, CMat};
use crate::lmi::Settings;
use crate::lmi::outcome::Outcome;

/// The start lies this factor above the worst point of the least-squares taps (in t), far enough inside for
/// the first Newton step.
const START_MARGIN: f64 = 2.0;
/// Steps without a smaller gap after which the iteration ends.
const PATIENCE: usize = 6;

/// Taps of least worst-case norm with the interval that the optimum lies in.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Why the iteration ended.
    pub outcome: Outcome,
    /// `F_j`, M x N for each lag.
    pub taps: Taps,
    /// Largest `sigma_max(K_l)` of these taps over the points.
    pub gamma: f64,
    /// Index of the point where it is attained.
    pub worst_point: usize,
    /// Lower bound on gamma for all taps of the same lags, rounding errors subtracted.
    pub lower: LowerBound,
    /// The matrices `Y_l` (M x q) that prove it through [`super::lower_bound`].
    pub dual: Vec<CMat>,
    /// Iteration record.
    pub steps: Vec<Step>,
}

impl Solution {
    /// `(gamma - lower) / gamma`, 0 when gamma is 0.
    pub fn relative_gap(&self) -> f64 {
        if self.gamma > 0.0 { (self.gamma - self.lower.value).max(0.0) / self.gamma } else { 0.0 }
    }
}

/// Minimises the worst-case norm. See the module's text for the problem and the method.
///
/// Every well-formed problem has a solution: the result holds the best taps found, their worst case over the
/// points and a lower bound, whatever the outcome.
///
/// # Errors
/// [`SampledError::Setting`] for a setting out of its range, [`SampledError::Linalg`] if a decomposition
/// does not converge.
pub fn minimise(problem: &Problem, settings: &Settings) -> Result<Solution, SampledError> {
    settings.check()?;
    let mut reduced = Reduced::new(problem)?;
    if reduced.layout.unknowns() == 0 {
        return fixed(problem);
    }
    let basis = Basis::new(&reduced, vec![1.0; reduced.count()])?;
    let x = basis.least_squares(&reduced, &reduced.w, settings.tol_rank);
    let mut best = Best::new(problem, reduced.taps(&x), settings)?;
    if best.solved(settings.tol_gap_rel) {
        return Ok(best.finish(Outcome::Solved, Vec::new()));
    }
    // Shift and scale to the least-squares solution: the rest is of order one.
    let scale = best.gamma;
    reduced.w = reduced.error(&x);
    reduced.rescale(scale);
    let run = Run { problem, reduced: &reduced, basis: &basis, settings, start: x, scale };
    let (outcome, steps) = run.iterate(&mut best)?;
    Ok(best.finish(outcome, steps))
}

/// A problem without taps: its singular vectors attain the lower bound.
fn fixed(problem: &Problem) -> Result<Solution, SampledError> {
    let taps = problem.zero_taps();
    let (gamma, worst_point) = problem.worst(&taps)?;
    let mut dual = bound::zero_dual(problem);
    let svd = linalg::svd(&problem.points()[worst_point].w)?;
    dual[worst_point] = svd.u.column(0) * svd.v.column(0).adjoint();
    let lower = LowerBound { covered: Covered::All, ..bound::lower_bound(problem, &dual, 0.0)? };
    Ok(Solution { outcome: Outcome::Solved, taps, gamma, worst_point, lower, dual, steps: Vec::new() })
}

struct Best<'a> {
    problem: &'a Problem,
    floor: f64,
    taps: Taps,
    gamma: f64,
    worst_point: usize,
    lower: LowerBound,
    dual: Vec<CMat>,
}

impl<'a> Best<'a> {
    fn new(problem: &'a Problem, taps: Taps, settings: &Settings) -> Result<Self, SampledError> {
        let (gamma, worst_point) = problem.worst(&taps)?;
        let floor = settings.tol_gap_abs * problem.worst(&problem.zero_taps())?.0;
        let (lower, dual) = (LowerBound::zero(), bound::zero_dual(problem));
        Ok(Self { problem, floor, taps, gamma, worst_point, lower, dual })
    }

    fn gap(&self) -> f64 {
        (self.gamma - self.lower.value).max(0.0)
    }

    fn solved(&self, relative: f64) -> bool {
        self.gap() <= (relative * self.gamma).max(self.floor)
    }

    fn offer_taps(&mut self, taps: Taps) -> Result<(), SampledError> {
        let (gamma, worst_point) = self.problem.worst(&taps)?;
        if gamma < self.gamma {
            (self.taps, self.gamma, self.worst_point) = (taps, gamma, worst_point);
        }
        Ok(())
    }

    fn finish(self, outcome: Outcome, steps: Vec<Step>) -> Solution {
        let Self { taps, gamma, worst_point, lower, dual, .. } = self;
        Solution { outcome, taps, gamma, worst_point, lower, dual, steps }
    }
}

/// Everything that stays fixed while iterating.
struct Run<'a> {
    problem: &'a Problem,
    reduced: &'a Reduced,
    basis: &'a Basis,
    settings: &'a Settings,
    start: Vec<f64>,
    scale: f64,
}

impl Run<'_> {
    fn iterate(&self, best: &mut Best<'_>) -> Result<(Outcome, Vec<Step>), SampledError> {
        let mut steps = Vec::new();
        let zero = vec![0.0; self.start.len()];
        let Some(mut engine) = Engine::new(self.reduced, Objective::WorstCase, zero, START_MARGIN) else {
            return Ok((Outcome::NumericalTrouble, steps));
        };
        let (mut least, mut waited) = (f64::INFINITY, 0);
        while steps.len() < self.settings.max_iterations {
            let merit = engine.cone.gap() / engine.cone.t + norm(engine.dual_residual());
            if merit <= 4.0 * self.settings.tol_gap_rel {
                self.judge(&engine, best)?;
                if best.solved(self.settings.tol_gap_rel) {
                    return Ok((Outcome::Solved, steps));
                }
            }
            waited = if merit < 0.9 * least { 0 } else { waited + 1 };
            least = least.min(merit);
            if waited > PATIENCE {
                break;
            }
            match engine.step(self.settings) {
                Ok(step) => steps.push(step),
                Err(_) => break,
            }
        }
        self.judge(&engine, best)?;
        let limit_reached = steps.len() >= self.settings.max_iterations;
        let solved = [self.settings.tol_gap_rel, self.settings.tol_gap_reduced].map(|tol| best.solved(tol));
        let outcome = Outcome::at_end(solved, limit_reached);
        Ok((outcome, steps))
    }

    /// Computed norm of the taps of the iterate, and the lower bound that its dual matrices give.
    fn judge(&self, engine: &Engine<'_>, best: &mut Best<'_>) -> Result<(), SampledError> {
        let x: Vec<f64> = self.start.iter().zip(&engine.x).map(|(a, b)| a + self.scale * b).collect();
        best.offer_taps(self.reduced.taps(&x))?;
        let cover = bound::cover(self.problem, self.reduced, self.basis, (&best.taps, best.gamma))?;
        let (lower, dual) =
            bound::from_iterate(self.problem, self.reduced, self.basis, &engine.cone.z, cover)?;
        if lower.value > best.lower.value {
            (best.lower, best.dual) = (lower, dual);
        }
        Ok(())
    }
}
