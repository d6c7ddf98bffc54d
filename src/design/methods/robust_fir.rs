//! FIR design for delays, gains and cut-offs that are known up to a box of errors only.
//!
//! The taps minimise the largest norm over scenarios: points of the box, each with a plant of its own. A
//! scenario is nothing but more frequencies, so the exchange of [`crate::design::exchange`] solves it: it
//! adds pairs of a frequency and a scenario where the error peaks, not whole grids per scenario, and its
//! dual stays a lower bound for all banks of that length over the box. Here the taps are fixed;
//! `scheduled_fir` is the same problem with more unknowns, for taps that are scheduled by the delays.

use super::scenarios::{ACCURACY, MARGIN, MovedPlant, RobustNorms, RobustProblem, largest};
use super::{Filters, Settings, Synthesis, fir, tap_lags};
use crate::design::DesignError;
use crate::design::error_grid::{ErrorGrid, Scenario};
use crate::design::exchange::{Exchange, Tolerances};
use crate::design::filters::{impulse_responses, polyphase};
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
    let moved = problem.moved_plants(plant)?;
    let grid = grid(plant, &moved, settings);
    let study = study_of(&nominal, taps, &grid, problem)?;
    if study.nominal.worst <= study.lower * (1.0 + NO_GAIN) {
        return Ok(Synthesis { robust: Some(study), ..nominal });
    }
    let found = least_worst_norm(plant, grid, settings)?;
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
    grid: &ErrorGrid<'_>,
    problem: &RobustProblem,
) -> Result<RobustStudy, DesignError> {
    let mut scenarios = estimates(grid, taps)?;
    let norms = RobustNorms { nominal: nominal.peak.gain, worst: worst_of(&scenarios, taps)? };
    // Whatever the taps, each scenario alone has the error that no bank avoids. That is at most the norm of
    // these taps there, so the scenarios with the largest norms come first.
    scenarios.sort_by(|a, b| b.norm.total_cmp(&a.norm));
    let mut unavoidable = nominal.lower;
    for Estimate { plant, norm } in scenarios {
        if norm <= unavoidable {
            break;
        }
        unavoidable = unavoidable.max(plant.noncausal_bound()?.gain);
    }
    Ok(RobustStudy {
        errors: problem.errors.clone(),
        robust: norms,
        nominal: norms,
        lower: unavoidable.min(norms.worst),
        scenarios: grid.scenarios().len() - 1,
        pairs: 0,
    })
}

/// A plant with the estimated norm of some taps.
#[derive(Clone, Copy)]
struct Estimate<'a> {
    plant: &'a LiftedPlant,
    norm: f64,
}

/// The norms of the taps over the scenarios with errors, estimated.
fn estimates<'a>(grid: &ErrorGrid<'a>, taps: &[Vec<f64>]) -> Result<Vec<Estimate<'a>>, DesignError> {
    let scenarios = grid.scenarios();
    let norms = grid.estimates(&polyphase(taps, scenarios[0].plant.ratio()))?;
    let all = scenarios.iter().zip(norms).map(|(scenario, norm)| Estimate { plant: scenario.plant, norm });
    // The first scenario has no errors.
    Ok(all.skip(1).collect())
}

/// The largest norm of the taps over the scenarios.
fn worst_of(scenarios: &[Estimate<'_>], taps: &[Vec<f64>]) -> Result<f64, DesignError> {
    let most = scenarios.iter().map(|scenario| scenario.norm).fold(0.0, f64::max);
    let near = scenarios.iter().filter(|scenario| scenario.norm >= NEAR_WORST * most);
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
    grid: ErrorGrid<'_>,
    settings: &Settings,
) -> Result<RobustTaps, DesignError> {
    let mut exchange = exchange(plant, grid, settings)?;
    exchange.stop = settings.stop.clone();
    let found = exchange.optimise_at(Tolerances::gradual(ACCURACY))?;
    let taps = impulse_responses(&found.taps, settings.taps);
    let peak = plant.fir_norm(&taps)?;
    let worst = worst_of(&estimates(exchange.error(), &taps)?, &taps)?;
    let norms = RobustNorms { nominal: peak.gain, worst };
    let pairs = exchange.frequencies().count();
    Ok(RobustTaps { taps, peak, norms, lower: exchange.lower, pairs, iterations: exchange.iterations })
}

/// The plant without errors, then the scenarios.
fn grid<'a>(plant: &'a LiftedPlant, moved: &'a [MovedPlant], settings: &Settings) -> ErrorGrid<'a> {
    let plants = std::iter::once(plant).chain(moved.iter().map(|moved| &moved.plant));
    let scenarios = plants.map(|plant| Scenario::new(plant, vec![1.0], 1.0)).collect();
    ErrorGrid::of_scenarios(scenarios, tap_lags(plant.ratio(), settings.taps)[0])
}

fn exchange<'a>(
    plant: &LiftedPlant,
    grid: ErrorGrid<'a>,
    settings: &Settings,
) -> Result<Exchange<ErrorGrid<'a>>, DesignError> {
    let (points, weights) = grid.coarse(0);
    let noise = plant.problem().noise.clone();
    let margin = settings.gamma_margin.unwrap_or(MARGIN).max(MARGIN);
    let problem = SampledProblem::new(points, tap_lags(plant.ratio(), settings.taps))?;
    Exchange::new(grid, problem, MeanSquareObjective { weights, noise }, margin)
}

#[cfg(test)]
mod tests;
