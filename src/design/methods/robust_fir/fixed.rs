//! Taps that stay as they are.

use super::grid_filters::GridFilters;
use super::norms::{ACCURACY, MARGIN, RobustNorms, lags, largest};
use super::scenario_grid::ScenarioGrid;
use super::scenarios::{RobustProblem, moved_plant, scenarios};
use super::sheets::{Sheet, Sheets};
use crate::design::DesignError;
use crate::design::exchange::{Exchange, Pace};
use crate::design::filters::{impulse_responses, polyphase};
use crate::design::methods::{Filters, Settings, Synthesis, fir};
use crate::design::plant::LiftedPlant;
use crate::lmi::sampled::{MeanSquareObjective, Problem as SampledProblem};
use crate::lti::peak::Peak;
use crate::verify::uncertainty::ErrorBox;

/// A nominal bank whose worst norm is within this of a lower bound is kept.
const NO_GAIN: f64 = 1e-3;
/// The norm is computed where its estimate is at least this share of the largest estimate: estimates are off
/// by a per cent or two.
const NEAR_WORST: f64 = 0.97;

/// The comparison of a robust design with one that takes the errors for zero.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RobustStudy {
    /// The box.
    pub errors: ErrorBox,
    /// Of this bank.
    pub robust: RobustNorms,
    /// Of the bank that is optimal without errors.
    pub nominal: RobustNorms,
    /// No FIR bank of this length has a smaller worst norm over the box (computed).
    pub lower: f64,
    /// Points of the box with a plant of their own.
    pub scenarios: usize,
    /// Pairs of a frequency and a scenario at the end; 0 if the nominal bank was kept.
    pub pairs: usize,
}

impl RobustStudy {
    /// The share by which the robust bank lowers the worst norm.
    pub fn gain(&self) -> f64 {
        if self.nominal.worst > 0.0 { 1.0 - self.robust.worst / self.nominal.worst } else { 0.0 }
    }
}

/// The `settings.taps` taps per channel of least norm over the scenarios, within 3e-4.
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
    let points = scenarios(&problem.errors);
    let plants =
        points.iter().map(|point| moved_plant(problem, plant, point)).collect::<Result<Vec<_>, _>>()?;
    let sheets = sheets(plant, &plants, settings);
    let study = study_of(&nominal, taps, &sheets, &plants, problem)?;
    if study.nominal.worst <= study.lower * (1.0 + NO_GAIN) {
        return Ok(Synthesis { robust: Some(study), ..nominal });
    }
    let found = least_worst_norm(plant, sheets, settings)?;
    let lower = found.lower.max(study.lower).min(found.norms.worst);
    let study = RobustStudy { lower, pairs: found.pairs, ..study };
    // The nominal bank is one of the candidates.
    if found.norms.worst >= study.nominal.worst {
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
fn study_of(
    nominal: &Synthesis,
    taps: &[Vec<f64>],
    sheets: &Sheets<'_>,
    plants: &[LiftedPlant],
    problem: &RobustProblem,
) -> Result<RobustStudy, DesignError> {
    let mut scenarios = estimates(sheets, taps)?;
    let norms = RobustNorms { nominal: nominal.peak.gain, worst: worst_of(&scenarios, taps)? };
    // Whatever the taps, each scenario alone has the error that no bank avoids. That is at most the norm of
    // these taps there, so the scenarios with the largest norms come first.
    scenarios.sort_by(|a, b| b.estimate.total_cmp(&a.estimate));
    let mut unavoidable = nominal.lower;
    for Scenario { plant, estimate } in scenarios {
        if estimate <= unavoidable {
            break;
        }
        unavoidable = unavoidable.max(plant.noncausal_bound()?.gain);
    }
    Ok(RobustStudy {
        errors: problem.errors.clone(),
        robust: norms,
        nominal: norms,
        lower: unavoidable.min(norms.worst),
        scenarios: plants.len(),
        pairs: 0,
    })
}

/// A plant with the estimated norm of some taps.
#[derive(Clone, Copy)]
struct Scenario<'a> {
    plant: &'a LiftedPlant,
    estimate: f64,
}

/// The norms of the taps over the scenarios, estimated.
fn estimates<'a>(sheets: &Sheets<'a>, taps: &[Vec<f64>]) -> Result<Vec<Scenario<'a>>, DesignError> {
    let lags = polyphase(taps, sheets.sheets[0].grid.plant().ratio());
    let response = sheets.response(&lags);
    let of = |sheet: &Sheet<'a>| {
        let filters = GridFilters { response: &response, factors: &sheet.factors };
        Ok(Scenario { plant: sheet.grid.plant(), estimate: sheet.grid.estimate(&filters)? })
    };
    // The first sheet has no errors.
    sheets.sheets[1..].iter().map(of).collect()
}

/// The largest norm of the taps over the scenarios.
fn worst_of(scenarios: &[Scenario<'_>], taps: &[Vec<f64>]) -> Result<f64, DesignError> {
    let most = scenarios.iter().map(|scenario| scenario.estimate).fold(0.0, f64::max);
    let near = scenarios.iter().filter(|scenario| scenario.estimate >= NEAR_WORST * most);
    largest(near.map(|scenario| Ok(scenario.plant.fir_norm(taps)?.gain)))
}

/// Taps of least norm over the scenarios.
struct RobustTaps {
    taps: Vec<Vec<f64>>,
    peak: Peak,
    norms: RobustNorms,
    /// No taps have a smaller worst norm.
    lower: f64,
    pairs: usize,
    iterations: usize,
}

fn least_worst_norm(
    plant: &LiftedPlant,
    sheets: Sheets<'_>,
    settings: &Settings,
) -> Result<RobustTaps, DesignError> {
    let mut exchange = exchange(plant, sheets, settings)?;
    let found = exchange.optimise_at(Pace::gradual(ACCURACY))?;
    let taps = impulse_responses(&found.taps, settings.taps);
    let peak = plant.fir_norm(&taps)?;
    let worst = worst_of(&estimates(exchange.error(), &taps)?, &taps)?;
    let norms = RobustNorms { nominal: peak.gain, worst };
    let pairs = exchange.frequencies().count();
    Ok(RobustTaps { taps, peak, norms, lower: exchange.lower, pairs, iterations: exchange.iterations })
}

/// The plant without errors, then the scenarios.
fn sheets<'a>(plant: &'a LiftedPlant, plants: &'a [LiftedPlant], settings: &Settings) -> Sheets<'a> {
    let lags = lags(plant.ratio(), settings.taps);
    let sheet = |plant| Sheet { grid: ScenarioGrid::new(plant, lags[0]), factors: vec![1.0], weight: 1.0 };
    let sheets = std::iter::once(plant).chain(plants).map(sheet).collect();
    Sheets { sheets, inputs: plant.channels() + plant.ratio() }
}

fn exchange<'a>(
    plant: &LiftedPlant,
    sheets: Sheets<'a>,
    settings: &Settings,
) -> Result<Exchange<Sheets<'a>>, DesignError> {
    let (points, weights) = sheets.sheets[0].grid.coarse();
    let noise = plant.problem().noise.clone();
    let points = points.iter().map(|point| sheets.point(0, point)).collect();
    let margin = settings.gamma_margin.unwrap_or(MARGIN).max(MARGIN);
    let problem = SampledProblem::new(points, lags(plant.ratio(), settings.taps))?;
    Exchange::new(sheets, problem, MeanSquareObjective { weights, noise }, margin)
}
