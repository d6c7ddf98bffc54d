//! The bank with the least mean-square error of all causal banks: the Kalman filter, which is `iir` at
//! gamma = infinity.

use super::filtering::{Filter, Innovations};
use super::gamma_iteration::GammaIteration;
use super::precise_filtering::{MOST_STATES_AT_106_BITS, MOST_STATES_AT_512_BITS, PreciseFiltering};
use super::{Settings, Synthesis};
use crate::arithmetic::{BigFloat, DoubleDouble, Number};
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;
use crate::lti::gramian::h2_norm;

/// Feedthrough of a measurement, relative to its size, below which the Riccati equation in double precision
/// may lose the digits of its noise.
const FAINT_FEEDTHROUGH: f64 = 1e-4;

/// The filters of least mean-square error for white noise at the analog input. The method has no settings.
///
/// # Errors
/// [`DesignError::RiccatiFailed`] if the Riccati equation could not be solved, [`DesignError::Lti`] if the
/// plant is not stable.
pub(crate) fn synthesise(plant: &LiftedPlant, _: &Settings) -> Result<Synthesis, DesignError> {
    let innovations = Innovations::in_all_coordinates(plant)?;
    let mut iteration = GammaIteration::new(plant, &innovations)?;
    let mut candidates: Vec<Filter> = innovations.iter().filter_map(|form| form.h2()).collect();
    let doubtful = innovations.iter().any(|form| form.least_feedthrough() < FAINT_FEEDTHROUGH);
    if doubtful || candidates.is_empty() {
        candidates.extend(precise::<DoubleDouble>(plant, MOST_STATES_AT_106_BITS)?);
        candidates.extend(precise::<BigFloat>(plant, MOST_STATES_AT_512_BITS)?);
        sort_by_mean_square(plant, &mut candidates);
    }
    iteration.start_from(candidates.into_iter())?;
    let optimum = iteration.best().map_err(|_| DesignError::RiccatiFailed { gamma: f64::INFINITY })?;
    Ok(iteration.synthesis(optimum))
}

/// The mean-square optimal filter in the precision of `F`, for plants of at most `limit` states.
fn precise<F: Number>(plant: &LiftedPlant, limit: usize) -> Result<Option<Filter>, DesignError> {
    if plant.system().order() > limit {
        return Ok(None);
    }
    Ok(PreciseFiltering::<F>::new(plant)?.h2())
}

/// Sorts `filters` by the mean-square error that they have, least first. Filters that rounding made unstable
/// come last.
fn sort_by_mean_square(plant: &LiftedPlant, filters: &mut [Filter]) {
    let rms = |filter: &Filter| {
        let error = plant.error_system(filter).ok();
        error.and_then(|error| h2_norm(&error).ok()).unwrap_or(f64::INFINITY)
    };
    filters.sort_by(|a, b| rms(a).total_cmp(&rms(b)));
}
