//! FIR design for delays, gains and cut-offs that are known up to a box of errors only.
//!
//! The taps minimise the largest gain over the box. Each combination of errors is a scenario with the same
//! taps, and a scenario is nothing but more frequencies, so the exchange of [`crate::design::exchange`]
//! solves it: it adds pairs of a frequency and a combination where the error peaks, as the search of
//! [`crate::design::uncertainty::search`] finds them, and its dual stays a lower bound for all banks of that
//! length over the box.

use super::{Filters, Settings, Synthesis, fir, tap_lags};
use crate::design::DesignError;
use crate::design::error_grid::{AffineError, ErrorGrid, Location, Peaks};
use crate::design::exchange::{Exchange, Tolerances};
use crate::design::filters::{FilterResponse, impulse_responses, polyphase};
use crate::design::plant::LiftedPlant;
use crate::design::uncertainty::box_plant::{BoxPlant, Combination};
use crate::design::uncertainty::search::{BoxSearch, WorstErrors};
use crate::linalg::{self, CMat};
use crate::lmi::sampled::{MeanSquareObjective, Point, Problem as SampledProblem, Taps};
use crate::lti::peak::Peak;
use crate::spec::{ErrorBox, Method, Spec};
use crate::units::Seconds;

/// A nominal bank whose largest gain is within this of a lower bound is kept.
const NO_GAIN: f64 = 1e-3;

/// The comparison of a robust design with one that takes the errors for zero.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RobustStudy {
    /// The box.
    pub errors: ErrorBox<Seconds>,
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
    let front_ends = BoxPlant::new(plant.problem(), &problem.errors)?;
    let search = BoxSearch::new(front_ends, tap_lags(plant.ratio(), settings.taps)[0], &[])?;
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
        robust,
    })
}

/// The study of a design that keeps the nominal bank.
fn study_of(nominal: &Synthesis, taps: &[Vec<f64>], search: &BoxSearch) -> Result<RobustStudy, DesignError> {
    let worst = worst_of(search, taps)?;
    // Whatever the taps, each combination of errors alone has the error that no bank avoids.
    let unavoidable = search.plant().moved(&worst.point).noncausal_bound()?.gain;
    let norms = RobustNorms { nominal: nominal.peak.gain, largest_found: worst.peak.gain };
    let errors = search.plant().errors.in_seconds(search.plant().fast_period());
    Ok(RobustStudy {
        errors,
        robust: norms,
        nominal: norms,
        lower: nominal.lower.max(unavoidable).min(norms.largest_found),
        scenarios: 0,
        pairs: 0,
    })
}

/// The largest norm found of the taps over the box.
fn worst_of(search: &BoxSearch, taps: &[Vec<f64>]) -> Result<WorstErrors, DesignError> {
    let filters = FilterResponse::Polynomial(polyphase(taps, search.plant().ratio()));
    search.worst(&filters, |plant| plant.fir_norm(taps))
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
        let scenario = exchange.error_mut().search.include(&worst.point);
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
        let found = self.search.peaks(&FilterResponse::Polynomial(taps.clone()), level)?;
        Ok(Peaks { estimate: found.estimate.max(gamma), ..found })
    }
}

fn exchange(
    plant: &LiftedPlant,
    search: BoxSearch,
    settings: &Settings,
) -> Result<Exchange<BoxError>, DesignError> {
    let lags = tap_lags(plant.ratio(), settings.taps);
    let (points, weights) = ErrorGrid::new(plant, lags[0])?.coarse();
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
const NORM_ACCURACY: f64 = 1e-4;
/// Relative margin of that norm for the least mean square without errors.
const NORM_MARGIN: f64 = 2e-4;

/// The norms of a bank, computed (h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct RobustNorms {
    /// Without errors.
    pub nominal: f64,
    /// The largest that a search over the box found; see `gamma.worst_case` for a bound that is proven.
    pub largest_found: f64,
}

/// Limit on the number of times that an exchange is repeated with errors that it did not know.
const MISSED_ERROR_LIMIT: usize = 8;

/// What a robust design is made for.
#[derive(Debug, Clone)]
pub(crate) struct RobustProblem {
    /// The box.
    pub(crate) errors: ErrorBox,
}

impl RobustProblem {
    /// The problem of a spec whose bank is to be robust: FIR for channels with errors.
    pub(crate) fn of(spec: &Spec) -> Option<Self> {
        let errors = spec.error_box()?;
        let is_robust = spec.design.method == Method::Fir && errors.sides() > 0;
        is_robust.then_some(Self { errors })
    }
}

#[cfg(test)]
mod tests;
