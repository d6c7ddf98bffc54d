//! The bank with the least mean-square error of all causal banks, for white noise at the analog input and
//! the noise of the converters: the Kalman filter, which is `iir` at gamma = infinity.

use super::Synthesis;
use super::filtering::{Innovations, ReferenceFilter};
use super::gamma_iteration::GammaIteration;
use super::precise_filtering::PreciseFiltering;
use crate::design::DesignError;
use crate::design::limits::{MOST_STATES_AT_106_BITS, MOST_STATES_AT_512_BITS, Stop};
use crate::design::plant::LiftedPlant;
use crate::lti::LtiError;
use crate::lti::gramian::h2_norm;
use hybank_verify::arithmetic::{DoubleDouble, Float, Float512};
use std::rc::Rc;

/// Feedthrough of a measurement, relative to its size, below which 106 bits may lose the digits of its
/// noise.
const FAINT_FEEDTHROUGH: f64 = 1e-4;
/// Errors up to this multiple of the least one count as the least.
const SAME_ERROR: f64 = 1.0 + 1e-6;

/// The filters with the least `||K||_2^2 + sum_i noise_i ||f_i||^2`. When `stop` is due, those of double
/// precision do.
///
/// # Errors
/// [`DesignError::RiccatiFailed`] if the Riccati equation could not be solved, [`DesignError::Lti`] if the
/// plant is not stable.
pub(crate) fn synthesise(plant: &LiftedPlant, stop: &Stop) -> Result<Synthesis, DesignError> {
    let noisy = plant.with_noise();
    let innovations = Innovations::in_all_coordinates(&noisy)?;
    // gamma is that of the signal alone, so the noise counts in the filters and not in the bounds.
    let mut iteration = GammaIteration::new(plant, &[Rc::new(Innovations::new(plant)?)], &Stop::default())?;
    let mut candidates: Vec<ReferenceFilter> = innovations.iter().filter_map(|form| form.h2()).collect();
    // Double precision loses up to a fifth of the mean square after smooth front ends, and nothing shows it.
    let is_due = |candidates: &[ReferenceFilter]| !candidates.is_empty() && stop.is_due();
    let precise_filter = match is_due(&candidates) {
        true => None,
        false => precise::<DoubleDouble>(&noisy, MOST_STATES_AT_106_BITS)?,
    };
    let faint = innovations.iter().any(|form| form.least_feedthrough < FAINT_FEEDTHROUGH);
    if (faint || precise_filter.is_none()) && !is_due(&candidates) {
        candidates.extend(precise::<Float512>(&noisy, MOST_STATES_AT_512_BITS)?);
    }
    candidates.extend(precise_filter);
    let rms = candidates.iter().map(|filter| rms_error(&noisy, filter)).collect::<Result<Vec<_>, _>>()?;
    let enough = SAME_ERROR * rms.iter().copied().fold(f64::INFINITY, f64::min);
    // Those of double precision come first: they keep the delay lines of the plant.
    let good = candidates.into_iter().zip(rms).filter(|(_, rms)| *rms <= enough);
    iteration.start_from(good.map(|(filter, _)| filter))?;
    let optimum = iteration.best().map_err(|error| match error {
        DesignError::RiccatiFailed { .. } => iteration.failed(None),
        other => other,
    })?;
    Ok(iteration.synthesis(optimum))
}

/// The mean-square optimal filter in the precision of `F`, for plants of at most `limit` states.
fn precise<F: Float>(plant: &LiftedPlant, limit: usize) -> Result<Option<ReferenceFilter>, DesignError> {
    if plant.system().order() > limit {
        return Ok(None);
    }
    Ok(PreciseFiltering::<F>::new(plant)?.h2())
}

/// ||K||_2 with the noise; infinite for a filter that rounding made unstable, whose Gramian has no limit.
fn rms_error(plant: &LiftedPlant, filter: &ReferenceFilter) -> Result<f64, DesignError> {
    match h2_norm(&plant.error_system(filter)) {
        Err(LtiError::IterationLimit { .. }) => Ok(f64::INFINITY),
        norm => Ok(norm?),
    }
}
