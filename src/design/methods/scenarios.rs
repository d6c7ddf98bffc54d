//! Points of a box of errors, each with a plant of its own, and the norms of banks over them.

use super::tap_lags;
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use crate::design::uncertainty::box_plant::BoxPlant;
use crate::design::uncertainty::search::BoxSearch;
use crate::spec::{Method, Spec};
use crate::verify::uncertainty::{ErrorBox, ErrorPoint, Side};

/// Relative width of the interval of the worst norm over the scenarios.
pub(super) const ACCURACY: f64 = 1e-4;
/// Relative margin of that norm for the least mean square without errors.
pub(super) const MARGIN: f64 = 2e-4;

/// The norms of a bank, computed (h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct RobustNorms {
    /// Without errors.
    pub nominal: f64,
    /// The largest that a search over the box found; see `gamma.worst_case` for a bound that is proven.
    pub largest_found: f64,
}

/// Limit on the number of times that an exchange is repeated with errors that it did not know.
pub(super) const MISSED_ERROR_LIMIT: usize = 8;

/// Most scenarios to begin with.
pub(super) const MAX_SCENARIOS: usize = 64;
/// Points on each side of the box that are tried, most first.
const STEPS: [usize; 4] = [9, 5, 3, 2];

/// What a robust design is made for.
#[derive(Debug, Clone)]
pub(crate) struct RobustProblem {
    /// The spec with all defaults.
    pub(crate) spec: Spec,
    /// The box.
    pub(crate) errors: ErrorBox,
}

impl RobustProblem {
    /// The problem of a spec whose bank is to be robust: FIR for channels with errors.
    pub(crate) fn of(spec: &Spec) -> Option<Self> {
        let errors = ErrorBox::of(spec.uncertainty.as_ref()?, spec.channels.len());
        let is_robust = spec.design.method == Method::Fir && !errors.is_point();
        is_robust.then(|| Self { spec: spec.clone(), errors })
    }

    /// The number of points with a plant of their own.
    pub(crate) fn scenario_count(&self) -> usize {
        scenarios(&self.errors).len()
    }

    /// The search for the worst errors of filters with so many taps; `plant` is the one without errors.
    ///
    /// # Errors
    /// As [`Problem::with_errors`].
    pub(super) fn search(&self, plant: &LiftedPlant, taps: usize) -> Result<BoxSearch, DesignError> {
        let front_ends = BoxPlant::new(&self.spec, plant.problem().latency, &self.errors)?;
        BoxSearch::new(front_ends, tap_lags(plant.ratio(), taps)[0], &[])
    }

    /// The scenarios with their plants; `plant` is the one without errors.
    pub(super) fn moved_plants(&self, plant: &LiftedPlant) -> Result<Vec<MovedPlant>, DesignError> {
        let moved = |point: ErrorPoint| {
            let problem = Problem::with_errors(&self.spec, plant.problem().latency, &point)?;
            Ok(MovedPlant { plant: LiftedPlant::new(&problem)?, point })
        };
        scenarios(&self.errors).into_iter().map(moved).collect()
    }
}

/// A point of the box with its plant.
pub(super) struct MovedPlant {
    pub(super) point: ErrorPoint,
    pub(super) plant: LiftedPlant,
}

/// Points of the box: a lattice over all sides, or its ends where there are many, or its most different
/// corners where there are very many.
pub(super) fn scenarios(errors: &ErrorBox) -> Vec<ErrorPoint> {
    let sides = errors.sides();
    // The error is affine in the gains: only their ends matter.
    let steps = |side: &Side, most: usize| if matches!(side, Side::Gain(_)) { 2 } else { most };
    let count = |most: usize| sides.iter().fold(1usize, |all, side| all.saturating_mul(steps(side, most)));
    match STEPS.into_iter().find(|&most| count(most) <= MAX_SCENARIOS) {
        Some(most) => {
            let per_side: Vec<usize> = sides.iter().map(|side| steps(side, most)).collect();
            (0..count(most)).map(|index| lattice_point(errors, &sides, &per_side, index)).collect()
        }
        None => corners(errors, &sides),
    }
}

fn lattice_point(errors: &ErrorBox, sides: &[Side], per_side: &[usize], index: usize) -> ErrorPoint {
    let mut rest = index;
    let shares: Vec<f64> = per_side
        .iter()
        .map(|&count| {
            let step = rest % count;
            rest /= count;
            2.0 * step as f64 / (count - 1) as f64 - 1.0
        })
        .collect();
    errors.point_at(sides, &shares)
}

/// Rows of a Hadamard matrix and their opposites: corners that differ from each other in half of the sides.
fn corners(errors: &ErrorBox, sides: &[Side]) -> Vec<ErrorPoint> {
    let sign = |row: usize, side: usize| if (row & side).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
    (0..MAX_SCENARIOS)
        .map(|corner| {
            let (row, opposite) = (corner / 2, if corner % 2 == 0 { 1.0 } else { -1.0 });
            let shares: Vec<f64> = (0..sides.len()).map(|side| opposite * sign(row, side)).collect();
            errors.point_at(sides, &shares)
        })
        .collect()
}
