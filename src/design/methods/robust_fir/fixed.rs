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
    let worst = |taps: &[Vec<f64>]| largest(plants.iter().map(|plant| Ok(plant.fir_norm(taps)?.gain)));
    let of_nominal = RobustNorms { nominal: nominal.peak.gain, worst: worst(taps)? };
    // Whatever the taps, each scenario alone has the error that no bank avoids.
    let unavoidable =
        largest(plants.iter().map(|plant| Ok(plant.noncausal_bound()?.gain)))?.max(nominal.lower);
    let study = RobustStudy {
        errors: problem.errors.clone(),
        robust: of_nominal,
        nominal: of_nominal,
        lower: unavoidable.min(of_nominal.worst),
        scenarios: plants.len(),
        pairs: 0,
    };
    if of_nominal.worst <= unavoidable * (1.0 + NO_GAIN) {
        return Ok(Synthesis { robust: Some(study), ..nominal });
    }
    let mut exchange = exchange(plant, &plants, settings)?;
    let found = exchange.optimise_to(ACCURACY)?;
    let robust_taps = impulse_responses(&found.taps, settings.taps);
    let peak = plant.fir_norm(&robust_taps)?;
    let robust = RobustNorms { nominal: peak.gain, worst: worst(&robust_taps)? };
    let lower = exchange.lower.max(unavoidable).min(robust.worst);
    let pairs = exchange.frequencies().count();
    let study = RobustStudy { robust, lower, pairs, ..study };
    // The nominal bank is one of the candidates.
    if robust.worst >= of_nominal.worst {
        return Ok(Synthesis { robust: Some(RobustStudy { robust: of_nominal, ..study }), ..nominal });
    }
    Ok(Synthesis {
        filters: Filters::Fir(robust_taps),
        peak,
        lower: nominal.lower.min(peak.gain),
        noncausal: nominal.noncausal.min(peak.gain),
        iterations: nominal.iterations + exchange.iterations,
        dual: nominal.dual,
        robust: Some(study),
        affine: None,
    })
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
