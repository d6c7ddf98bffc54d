//! FIR design for delays, gains and cut-offs that are known up to a box of errors only.
//!
//! The taps minimise the largest gain over the box. Each combination of errors is a scenario with the same
//! taps, and a scenario is nothing but more frequencies, so the exchange of [`crate::design::exchange`]
//! solves it: it adds pairs of a frequency and a combination where the error peaks, as the search of
//! [`crate::design::uncertainty::search`] finds them, and its dual stays a lower bound for all banks of that
//! length over the box.

use super::{MethodSettings, Synthesis, fir, tap_lags};
use crate::design::DesignError;
use crate::design::error_grid::{AffineError, ErrorGrid, GridFrequency, LocatedPeak};
use crate::design::exchange::Exchange;
use crate::design::filters::FilterResponse;
use crate::design::plant::LiftedPlant;
use crate::design::uncertainty::box_plant::{BoxPlant, Combination};
use crate::design::uncertainty::search::BoxSearch;
use crate::lmi::sampled::{FrequencyPoint, MeanSquareObjective, SampledProblem};
use crate::lti::FirMatrix;
use hybank_core::bank::SynthesisFilters;
use hybank_core::spec::{ErrorBox, Method, Spec};
use hybank_core::units::Seconds;
use hybank_linalg::CMat;

/// What a robust design tolerates.
struct Settings {
    /// A nominal bank whose largest gain is within this of a lower bound is kept: 0.01 dB does not matter.
    no_gain: f64,
    /// Relative width of the interval of the worst norm over the scenarios: 0.001 dB, as each round costs a
    /// search of the box.
    norm_accuracy: f64,
    /// Relative margin of that norm for the least mean square without errors: twice its accuracy, or
    /// nothing could be gained.
    norm_margin: f64,
    /// Relative gap to which the mean square is least: a thousandth more error does not matter.
    mean_square_gap: f64,
}

/// Of every design.
const SETTINGS: Settings =
    Settings { no_gain: 1e-3, norm_accuracy: 1e-4, norm_margin: 2e-4, mean_square_gap: 1e-3 };

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
    settings: &MethodSettings,
    errors: &ErrorBox,
) -> Result<Synthesis, DesignError> {
    let nominal = fir::synthesise(plant, settings)?;
    let front_ends = BoxPlant::new(plant.problem(), errors)?;
    let search = BoxSearch::new(front_ends, tap_lags(plant.ratio(), settings.taps)[0], &[])?;
    let study = study_of(&nominal, &search)?;
    if study.nominal.largest_found <= study.lower * (1.0 + SETTINGS.no_gain) {
        return Ok(Synthesis { robust: Some(study), ..nominal });
    }
    let (study, found) = least_worst_norm(plant, search, settings, study)?;
    // The nominal bank is one of the candidates.
    if study.robust.largest_found >= study.nominal.largest_found {
        return Ok(Synthesis { robust: Some(RobustStudy { robust: study.nominal, ..study }), ..nominal });
    }
    Ok(Synthesis { lower: nominal.lower.min(found.peak.gain), robust: Some(study), ..found })
}

/// The study of a design that keeps the nominal bank.
fn study_of(nominal: &Synthesis, search: &BoxSearch) -> Result<RobustStudy, DesignError> {
    let worst = search.worst(&nominal.filters)?;
    // Whatever the taps, each combination of errors alone has the error that no bank avoids.
    let unavoidable = search.plant.moved(&worst.combination).noncausal_bound()?.gain;
    let norms = RobustNorms { nominal: nominal.peak.gain, largest_found: worst.peak.gain };
    let errors = search.plant.errors.in_seconds(search.plant.problem.fast_period);
    Ok(RobustStudy {
        errors,
        robust: norms,
        nominal: norms,
        lower: nominal.lower.max(unavoidable).min(norms.largest_found),
        scenarios: 0,
        pairs: 0,
    })
}

/// The exchange, with what it found for the study. Where the taps are worse between the frequencies that the
/// search looks at, it is repeated with these.
fn least_worst_norm(
    plant: &LiftedPlant,
    search: BoxSearch,
    settings: &MethodSettings,
    study: RobustStudy,
) -> Result<(RobustStudy, Synthesis), DesignError> {
    let mut exchange = exchange(plant, search, settings)?;
    let mut rounds = 0;
    let (taps, largest_found) = loop {
        let found = exchange.optimise_to(SETTINGS.norm_accuracy, SETTINGS.mean_square_gap)?;
        let taps = found.taps.impulse_responses(settings.taps);
        let worst = exchange.error.search.worst(&SynthesisFilters::Fir(taps.clone()))?;
        let enough = found.estimate.max(exchange.lower) * (1.0 + SETTINGS.norm_accuracy);
        rounds += 1;
        if worst.peak.gain <= enough || rounds == MISSED_ERROR_LIMIT || exchange.stop.is_due() {
            break (taps, worst.peak.gain);
        }
        let location = GridFrequency { frequency: worst.peak.frequency, scenario: worst.combination };
        if !exchange.add(&[location]) {
            break (taps, worst.peak.gain);
        }
    };
    let peak = plant.fir_norm(&taps)?;
    let mut scenarios: Vec<_> = exchange.locations.iter().map(|location| &location.scenario).collect();
    scenarios.sort();
    scenarios.dedup();
    let study = RobustStudy {
        robust: RobustNorms { nominal: peak.gain, largest_found },
        lower: exchange.lower.max(study.lower).min(largest_found),
        scenarios: scenarios.len(),
        pairs: exchange.locations.len(),
        ..study
    };
    Ok((study, Synthesis::of_least_gamma(plant, taps, peak, 0.0)?))
}

/// The error of fixed taps over the box.
struct BoxError {
    search: BoxSearch,
    /// N + M, the columns of all points.
    inputs: usize,
}

impl AffineError for BoxError {
    type Scenario = Combination;

    fn at(&self, location: &GridFrequency<Combination>) -> FrequencyPoint {
        let response = self.search.plant.response(location.frequency);
        let h = self.search.plant.measurements(&response, &location.scenario);
        let count = h.nrows();
        let g = hybank_linalg::lq_factor(&hybank_linalg::vstack(&[&h, &response.references]));
        let rows = |first: usize, rows: usize| -> CMat {
            g.rows(first, rows).into_owned().resize_horizontally(self.inputs, Default::default())
        };
        FrequencyPoint { omega: location.frequency, h: rows(0, count), w: rows(count, g.nrows() - count) }
    }

    fn peaks(&self, taps: &FirMatrix, level: f64) -> Result<Vec<LocatedPeak<Combination>>, DesignError> {
        self.search.peaks(&FilterResponse::Polynomial(taps.clone()), level)
    }
}

fn exchange(
    plant: &LiftedPlant,
    search: BoxSearch,
    settings: &MethodSettings,
) -> Result<Exchange<BoxError>, DesignError> {
    let lags = tap_lags(plant.ratio(), settings.taps);
    let (points, weights) = ErrorGrid::new(plant, lags[0])?.coarse();
    let noise = plant.problem().noise.clone();
    let margin = settings.gamma_margin.unwrap_or(SETTINGS.norm_margin).max(SETTINGS.norm_margin);
    let problem = SampledProblem::new(points, lags);
    let without_errors = std::iter::repeat(vec![0; search.plant.errors.delays.len()]);
    let error = BoxError { search, inputs: plant.channels() + plant.ratio() };
    let objective = MeanSquareObjective { weights, noise };
    let mut exchange = Exchange::new(error, problem, without_errors, objective, margin);
    exchange.stop = settings.stop.clone();
    Ok(exchange)
}

/// The norms of a bank, computed (h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct RobustNorms {
    /// Without errors.
    pub nominal: f64,
    /// The largest that a search over the box found; see `gamma.worst_case` for a bound that is proven.
    pub largest_found: f64,
}

/// Limit on the number of times that an exchange is repeated with a peak that it did not know.
const MISSED_ERROR_LIMIT: usize = 8;

/// The box of a spec whose bank is to be robust: FIR for channels with errors.
pub(crate) fn robust_box(spec: &Spec) -> Option<ErrorBox> {
    let is_robust = |errors: &ErrorBox| spec.design.method == Method::Fir && errors.sides() > 0;
    spec.error_box().filter(is_robust)
}

#[cfg(test)]
mod tests;
