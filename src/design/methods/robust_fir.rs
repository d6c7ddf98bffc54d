//! FIR design for delays, gains and cut-offs that are known up to a box of errors only.
//!
//! The taps minimise the largest gain over the box. Each combination of errors is a scenario with the same
//! taps, and a scenario is nothing but more frequencies, so the exchange of [`crate::design::exchange`]
//! solves it: it adds pairs of a frequency and a combination where the error peaks, as the search of
//! [`crate::design::uncertainty::search`] finds them, and its dual stays a lower bound for all banks of that
//! length over the box. Here the taps are fixed; `scheduled_fir` has taps that are scheduled by the delays.

use super::{Filters, Settings, Synthesis, fir, tap_lags};
use crate::design::DesignError;
use crate::design::error_grid::{AffineError, ErrorGrid, Location, Peaks};
use crate::design::exchange::{Exchange, Tolerances};
use crate::design::filters::{impulse_responses, polyphase};
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use crate::design::uncertainty::box_plant::{BoxPlant, Combination};
use crate::design::uncertainty::moving_filters::MovingFilters;
use crate::design::uncertainty::search::BoxSearch;
use crate::linalg::{self, CMat};
use crate::lmi::sampled::{MeanSquareObjective, Point, Problem as SampledProblem, Taps};
use crate::lti::peak::Peak;
use crate::spec::{Method, Spec};
use crate::verify::uncertainty::{ErrorBox, ErrorPoint, Side};

/// A nominal bank whose largest gain is within this of a lower bound is kept.
const NO_GAIN: f64 = 1e-3;

/// The comparison of a robust design with one that takes the errors for zero.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RobustStudy {
    /// The box.
    pub errors: ErrorBox,
    /// Of this bank.
    pub robust: RobustNorms,
    /// Of the bank that is optimal without errors.
    pub nominal: RobustNorms,
    /// No FIR bank of this length has a smaller largest norm over the box (computed).
    pub lower: f64,
    /// Combinations of errors among the pairs.
    pub scenarios: usize,
    /// Pairs of a frequency and a combination of errors at the end; 0 if the nominal bank was kept.
    pub pairs: usize,
}

impl RobustStudy {
    /// The share by which the robust bank lowers the largest norm that was found.
    pub fn gain(&self) -> f64 {
        if self.nominal.largest_found > 0.0 {
            1.0 - self.robust.largest_found / self.nominal.largest_found
        } else {
            0.0
        }
    }
}

/// The `settings.taps` taps per channel of least norm over the box, within 3e-4.
///
/// # Errors
/// As [`fir::synthesise`].
pub(crate) fn synthesise(
    plant: &LiftedPlant,
    settings: &Settings,
    problem: &RobustProblem,
) -> Result<Synthesis, DesignError> {
    let nominal = fir::synthesise(plant, settings)?;
    let Filters::Fir(taps) = &nominal.filters else { return Ok(nominal) };
    let search = problem.search(plant, settings.taps)?;
    let study = study_of(&nominal, taps, &search)?;
    if study.nominal.largest_found <= study.lower * (1.0 + NO_GAIN) {
        return Ok(Synthesis { robust: Some(study), ..nominal });
    }
    let found = least_worst_norm(plant, search, settings)?;
    let lower = found.lower.max(study.lower).min(found.norms.largest_found);
    let study = RobustStudy { lower, pairs: found.pairs, scenarios: found.scenarios, ..study };
    // The nominal bank is one of the candidates.
    if found.norms.largest_found >= study.nominal.largest_found {
        return Ok(Synthesis { robust: Some(study), ..nominal });
    }
    let robust = Some(RobustStudy { robust: found.norms, ..study });
    Ok(Synthesis {
        lower: nominal.lower.min(found.peak.gain),
        noncausal: nominal.noncausal.min(found.peak.gain),
        iterations: nominal.iterations + found.iterations,
        filters: Filters::Fir(found.taps),
        peak: found.peak,
        dual: nominal.dual,
        robust,
        affine: None,
    })
}

/// The study of a design that keeps the nominal bank.
fn study_of(nominal: &Synthesis, taps: &[Vec<f64>], search: &BoxSearch) -> Result<RobustStudy, DesignError> {
    let worst = worst_of(search, taps)?;
    // Whatever the taps, each combination of errors alone has the error that no bank avoids.
    let unavoidable = search.plant().moved(&worst.point)?.noncausal_bound()?.gain;
    let norms = RobustNorms { nominal: nominal.peak.gain, largest_found: worst.peak.gain };
    Ok(RobustStudy {
        errors: search.plant().errors.clone(),
        robust: norms,
        nominal: norms,
        lower: nominal.lower.max(unavoidable).min(norms.largest_found),
        scenarios: 0,
        pairs: 0,
    })
}

/// Errors with the norm of some taps.
pub(super) struct WorstErrors {
    point: ErrorPoint,
    pub(super) peak: Peak,
}

/// The largest norm found of the taps over the box.
pub(super) fn worst_of(search: &BoxSearch, taps: &[Vec<f64>]) -> Result<WorstErrors, DesignError> {
    let filters = MovingFilters::fixed(polyphase(taps, search.plant().ratio()));
    let norm = |point: ErrorPoint| {
        let peak = search.plant().moved(&point)?.fir_norm(taps)?;
        Ok::<_, DesignError>(WorstErrors { point, peak })
    };
    let without_errors = norm(ErrorPoint::none(search.plant().errors.delays.len()))?;
    search.worst_points(&filters)?.into_iter().try_fold(without_errors, |worst, point| {
        let other = norm(point)?;
        Ok(if other.peak.gain > worst.peak.gain { other } else { worst })
    })
}

/// Taps of least norm over the box.
struct RobustTaps {
    taps: Vec<Vec<f64>>,
    peak: Peak,
    norms: RobustNorms,
    /// No taps have a smaller largest norm.
    lower: f64,
    scenarios: usize,
    pairs: usize,
    iterations: usize,
}

/// The exchange. Where the taps are worse between the errors or frequencies that the search looks at, it is
/// repeated with these.
fn least_worst_norm(
    plant: &LiftedPlant,
    search: BoxSearch,
    settings: &Settings,
) -> Result<RobustTaps, DesignError> {
    let mut exchange = exchange(plant, search, settings)?;
    let mut rounds = 0;
    let (taps, largest_found) = loop {
        let found = exchange.optimise_at(Tolerances::gradual(NORM_ACCURACY))?;
        let taps = impulse_responses(&found.taps, settings.taps);
        let worst = worst_of(&exchange.error().search, &taps)?;
        let enough = found.peaks.estimate.max(exchange.lower) * (1.0 + NORM_ACCURACY);
        rounds += 1;
        if worst.peak.gain <= enough || rounds == MISSED_ERROR_LIMIT || exchange.stop.is_due() {
            break (taps, worst.peak.gain);
        }
        let scenario = exchange.error_mut().search.include(&worst.point)?;
        if !exchange.add(&[Location { frequency: worst.peak.frequency, scenario }]) {
            break (taps, worst.peak.gain);
        }
    };
    let peak = plant.fir_norm(&taps)?;
    let norms = RobustNorms { nominal: peak.gain, largest_found };
    let (lower, iterations) = (exchange.lower_for_all, exchange.iterations);
    let pairs = exchange.locations().len();
    let mut scenarios: Vec<_> = exchange.locations().iter().map(|location| &location.scenario).collect();
    scenarios.sort();
    scenarios.dedup();
    Ok(RobustTaps { peak, norms, lower, scenarios: scenarios.len(), pairs, iterations, taps })
}

/// The error of fixed taps over the box.
struct BoxError {
    search: BoxSearch,
    /// N + M, the columns of all points.
    inputs: usize,
}

impl AffineError for BoxError {
    type Scenario = Combination;

    fn at(&self, location: &Location<Combination>) -> Point {
        let response = self.search.plant().response(location.frequency);
        let h = self.search.plant().measurements(&response, &location.scenario);
        let count = h.nrows();
        let g = linalg::lq_factor(&linalg::vstack(&[&h, &response.references]));
        let rows = |first: usize, rows: usize| -> CMat {
            g.rows(first, rows).into_owned().resize_horizontally(self.inputs, Default::default())
        };
        Point { omega: location.frequency, h: rows(0, count), w: rows(count, g.nrows() - count) }
    }

    fn peaks(&self, taps: &Taps, gamma: f64, level: f64) -> Result<Peaks<Combination>, DesignError> {
        let found = self.search.peaks(&MovingFilters::fixed(taps.clone()), level)?;
        Ok(Peaks { estimate: found.estimate.max(gamma), ..found })
    }
}

fn exchange(
    plant: &LiftedPlant,
    search: BoxSearch,
    settings: &Settings,
) -> Result<Exchange<BoxError>, DesignError> {
    let lags = tap_lags(plant.ratio(), settings.taps);
    let (points, weights) = ErrorGrid::new(plant, lags[0])?.coarse(0);
    let noise = plant.problem().noise.clone();
    let margin = settings.gamma_margin.unwrap_or(NORM_MARGIN).max(NORM_MARGIN);
    let problem = SampledProblem::new(points, lags);
    let without_errors = std::iter::repeat(vec![0; search.plant().errors.delays.len()]);
    let error = BoxError { search, inputs: plant.channels() + plant.ratio() };
    let objective = MeanSquareObjective { weights, noise };
    let mut exchange = Exchange::new(error, problem, without_errors, objective, margin);
    exchange.stop = settings.stop.clone();
    Ok(exchange)
}

/// Relative width of the interval of the worst norm over the scenarios.
pub(super) const NORM_ACCURACY: f64 = 1e-4;
/// Relative margin of that norm for the least mean square without errors.
pub(super) const NORM_MARGIN: f64 = 2e-4;

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
            Ok(MovedPlant { plant: LiftedPlant::new(&problem), point })
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

#[cfg(test)]
mod tests;
