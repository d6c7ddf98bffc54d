//! Taps of least worst-case norm over the points.

use super::basis::Basis;
use super::bound;
use super::interior::{InteriorIterate, Objective, norm};
use super::prepare::Reduced;
use super::problem::SampledProblem;
use crate::lmi::IsDue;
use crate::lmi::iteration::{self, Iterate};
use crate::lmi::settings::SETTINGS;
use crate::lti::FirMatrix;
use hybank_linalg::LinalgError;

/// Taps of least worst-case norm with the interval that the optimum lies in.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Whether the gap to the lower bound is within the tolerance.
    pub is_solved: bool,
    /// `F_j`, M x N for each lag.
    pub taps: FirMatrix,
    /// Largest `sigma_max(K_l)` of these taps over the points.
    pub gamma: f64,
    /// Lower bound on gamma for all taps of the same lags and of up to a thousand times the size of these,
    /// computed, rounding errors subtracted.
    pub lower: f64,
    /// Number of steps.
    pub iterations: usize,
}

/// Minimises the worst-case norm, to a relative duality gap. See the module's text for the problem and
/// the method.
///
/// Every well-formed problem has a solution: the result holds the best taps found, their worst case over the
/// points and a lower bound, solved or not. When the end `is_due`, they are the best so far.
///
/// # Errors
/// [`LinalgError`] if the data are not finite or a decomposition does not converge.
pub fn minimise(
    problem: &SampledProblem,
    tol_gap_rel: f64,
    is_due: IsDue<'_>,
) -> Result<Solution, LinalgError> {
    let mut reduced = Reduced::new(problem)?;
    if reduced.layout.unknowns() == 0 {
        return fixed(problem);
    }
    let basis = Basis::new(&reduced, vec![1.0; reduced.count()], &[])?;
    let x = basis.least_squares(&reduced, &reduced.w, SETTINGS.rank_tolerance);
    let best = LeastGamma::new(problem, reduced.taps(&x))?;
    if best.relative_gap() <= tol_gap_rel {
        return Ok(best.finish(true, 0));
    }
    // Shift and scale to the least-squares solution: the rest is of order one.
    let scale = best.gamma;
    reduced.w = reduced.error(&x);
    reduced.rescale(scale);
    let zero = vec![0.0; x.len()];
    let Some(engine) =
        InteriorIterate::new(&reduced, Objective::WorstCase, zero, SETTINGS.start_margin, is_due)
    else {
        return Ok(best.finish(false, 0));
    };
    let mut run =
        WorstCaseIteration { problem, reduced: &reduced, basis: &basis, start: x, scale, engine, best };
    let (is_solved, iterations) = iteration::run(&mut run, tol_gap_rel, is_due)?;
    if is_due() {
        run.offer_taps()?;
    }
    Ok(run.best.finish(is_solved, iterations))
}

/// A problem without taps: its worst case is the optimum.
fn fixed(problem: &SampledProblem) -> Result<Solution, LinalgError> {
    let taps = problem.zero_taps();
    let gamma = problem.worst(&taps)?;
    Ok(Solution { is_solved: true, taps, gamma, lower: gamma, iterations: 0 })
}

struct LeastGamma {
    /// Gap that counts as zero.
    floor: f64,
    taps: FirMatrix,
    gamma: f64,
    lower: f64,
}

impl LeastGamma {
    fn new(problem: &SampledProblem, taps: FirMatrix) -> Result<Self, LinalgError> {
        let gamma = problem.worst(&taps)?;
        let floor = SETTINGS.gap_of_zero * problem.worst(&problem.zero_taps())?;
        Ok(Self { floor, taps, gamma, lower: 0.0 })
    }

    fn relative_gap(&self) -> f64 {
        let gap = (self.gamma - self.lower).max(0.0);
        if gap <= self.floor { 0.0 } else { gap / self.gamma }
    }

    fn finish(self, is_solved: bool, iterations: usize) -> Solution {
        let Self { taps, gamma, lower, .. } = self;
        Solution { is_solved, taps, gamma, lower, iterations }
    }
}

/// The iteration, and what it has found.
struct WorstCaseIteration<'a> {
    problem: &'a SampledProblem,
    reduced: &'a Reduced,
    basis: &'a Basis,
    start: Vec<f64>,
    scale: f64,
    engine: InteriorIterate<'a>,
    best: LeastGamma,
}

impl WorstCaseIteration<'_> {
    /// Takes the taps of the iterate if they are better.
    fn offer_taps(&mut self) -> Result<(), LinalgError> {
        let x: Vec<f64> = self.start.iter().zip(&self.engine.x).map(|(a, b)| a + self.scale * b).collect();
        let taps = self.reduced.taps(&x);
        let gamma = self.problem.worst(&taps)?;
        if gamma < self.best.gamma {
            (self.best.taps, self.best.gamma) = (taps, gamma);
        }
        Ok(())
    }
}

impl Iterate for WorstCaseIteration<'_> {
    /// A quarter of the complementarity gap and of the residual: from there on, the gap of the bound that
    /// the dual matrices give is usually within the tolerance.
    fn gap(&mut self) -> f64 {
        let engine = &self.engine;
        0.25 * (engine.cone.gap() / engine.cone.t + norm(&engine.dual_residual()))
    }

    /// From the computed norm of the taps of the iterate and the lower bound that its dual matrices give.
    fn judged_gap(&mut self) -> Result<f64, LinalgError> {
        self.offer_taps()?;
        let best = &mut self.best;
        let radius = bound::radius(self.problem, self.reduced, self.basis, (&best.taps, best.gamma))?;
        let z = &self.engine.cone.z;
        let lower = bound::from_iterate(self.problem, self.reduced, self.basis, z, radius)?;
        best.lower = best.lower.max(lower);
        Ok(best.relative_gap())
    }

    fn step(&mut self) -> Option<()> {
        self.engine.step()
    }
}
