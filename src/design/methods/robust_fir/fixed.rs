//! Taps that stay as they are.

use super::norms::{ACCURACY, MARGIN, RobustNorms, lags, largest};
use super::scenarios::{RobustProblem, moved_plant, scenarios};
use super::sheets::{Sheet, Sheets};
use crate::design::DesignError;
use crate::design::error_grid::ErrorGrid;
use crate::design::exchange::Exchange;
use crate::design::filters::impulse_responses;
use crate::design::methods::{Filters, Settings, Synthesis, fir};
use crate::design::plant::LiftedPlant;
use crate::lmi::sampled::{MeanSquareObjective, Problem as SampledProblem};
use crate::lti::peak::Peak;
use crate::verify::uncertainty::ErrorBox;

/// A nominal bank whose worst norm is within this of a lower bound is kept.
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
    let study = study_of(&nominal, taps, &plants, problem)?;
    if study.nominal.worst <= study.lower * (1.0 + NO_GAIN) {
        return Ok(Synthesis { robust: Some(study), ..nominal });
    }
    let found = least_worst_norm(plant, &plants, settings)?;
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
    plants: &[LiftedPlant],
    problem: &RobustProblem,
) -> Result<RobustStudy, DesignError> {
    let norms = RobustNorms { nominal: nominal.peak.gain, worst: worst_norm(plants, taps)? };
    // Whatever the taps, each scenario alone has the error that no bank avoids.
    let unavoidable =
        largest(plants.iter().map(|plant| Ok(plant.noncausal_bound()?.gain)))?.max(nominal.lower);
    Ok(RobustStudy {
        errors: problem.errors.clone(),
        robust: norms,
        nominal: norms,
        lower: unavoidable.min(norms.worst),
        scenarios: plants.len(),
        pairs: 0,
    })
}

/// The largest norm of the taps over the scenarios.
fn worst_norm(plants: &[LiftedPlant], taps: &[Vec<f64>]) -> Result<f64, DesignError> {
    largest(plants.iter().map(|plant| Ok(plant.fir_norm(taps)?.gain)))
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
    plants: &[LiftedPlant],
    settings: &Settings,
) -> Result<RobustTaps, DesignError> {
    let mut exchange = exchange(plant, plants, settings)?;
    let found = exchange.optimise_to(ACCURACY)?;
    let taps = impulse_responses(&found.taps, settings.taps);
    let peak = plant.fir_norm(&taps)?;
    let norms = RobustNorms { nominal: peak.gain, worst: worst_norm(plants, &taps)? };
    let pairs = exchange.frequencies().count();
    Ok(RobustTaps { taps, peak, norms, lower: exchange.lower, pairs, iterations: exchange.iterations })
}

fn exchange<'a>(
    plant: &'a LiftedPlant,
    plants: &'a [LiftedPlant],
    settings: &Settings,
) -> Result<Exchange<Sheets<'a>>, DesignError> {
    let lags = lags(plant.ratio(), settings.taps);
    let sheet = |plant| Sheet { grid: ErrorGrid::new(plant, lags[0]), factors: vec![1.0], weight: 1.0 };
    let sheets: Vec<Sheet<'a>> = std::iter::once(plant).chain(plants).map(sheet).collect();
    let (points, weights) = sheets[0].grid.coarse();
    let noise = plant.problem().noise.clone();
    let sheets = Sheets { sheets, inputs: plant.channels() + plant.ratio() };
    let points = points.iter().map(|point| sheets.point(0, point)).collect();
    let margin = settings.gamma_margin.unwrap_or(MARGIN).max(MARGIN);
    Exchange::new(sheets, SampledProblem::new(points, lags)?, MeanSquareObjective { weights, noise }, margin)
}
