//! The least gamma of a KYP problem.

use super::iterate::{Iterate, Step};
use super::problem::{KypError, Problem};
use super::reduced::Reduced;
use crate::linalg::Mat;
use crate::lmi::Settings;
use crate::lmi::outcome::Outcome;
use crate::lti::GramianCoordinates;

/// The least gamma with its certificate and its lower bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// Why the iteration ended.
    pub outcome: Outcome,
    /// The unknowns.
    pub x: Vec<f64>,
    /// The LMI holds strictly (up to rounding) for this gamma, `p` and `x`.
    pub gamma: f64,
    /// Value of the dual covariance: a lower bound on gamma for all unknowns, up to rounding errors.
    pub lower: f64,
    /// P, r x r, in `coordinates`.
    pub p: Mat,
    /// The coordinates of P: those of the controllable states.
    pub coordinates: GramianCoordinates,
    /// Iteration record.
    pub steps: Vec<Step>,
}

/// Minimises gamma; the module documentation has the problem and the method.
///
/// Every problem has a solution, because A is stable and a norm is at least 0. The result holds the best
/// unknowns found and bounds on the optimum, whatever the outcome.
///
/// # Errors
/// [`KypError::Setting`] for a setting out of its range, [`KypError::Linalg`] if a decomposition does not
/// converge.
pub fn minimise(problem: &Problem, settings: &Settings) -> Result<Solution, KypError> {
    settings.check()?;
    let reduced = Reduced::new(problem, settings.tol_rank)?;
    let n = reduced.coordinates.a.nrows();
    if reduced.scale <= settings.tol_gap_abs * reduced.size {
        // The error of the least-squares unknowns is rounding error; its H2 norm stands for gamma.
        let x = reduced.unknowns(&[]);
        let (p, gamma) = (Mat::zeros(n, n), reduced.scale);
        let coordinates = reduced.coordinates;
        return Ok(Solution {
            outcome: Outcome::Solved,
            x,
            gamma,
            lower: 0.0,
            p,
            coordinates,
            steps: Vec::new(),
        });
    }
    let mut iterate = Iterate::new(&reduced)?;
    let (outcome, steps) = iterate.run(settings)?;
    let x = reduced.unknowns(&iterate.x);
    let (gamma, lower) = (iterate.gamma * reduced.scale, iterate.lower * reduced.scale);
    let p = iterate.p * reduced.scale;
    let lower = lower.clamp(0.0, gamma);
    Ok(Solution { outcome, x, gamma, lower, p, coordinates: reduced.coordinates, steps })
}
