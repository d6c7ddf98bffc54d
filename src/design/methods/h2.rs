//! The bank with the least mean-square error of all causal banks: the Kalman filter, which is `iir` at
//! gamma = infinity.

use super::filtering::Innovations;
use super::gamma_iteration::GammaIteration;
use super::{Settings, Synthesis};
use crate::design::DesignError;
use crate::design::plant::LiftedPlant;

/// The filters of least mean-square error for white noise at the analog input. The method has no settings.
///
/// # Errors
/// [`DesignError::RiccatiFailed`] if the Riccati equation could not be solved, [`DesignError::Lti`] if the
/// plant is not stable.
pub(crate) fn synthesise(plant: &LiftedPlant, _: &Settings) -> Result<Synthesis, DesignError> {
    let innovations = Innovations::in_all_coordinates(plant)?;
    let mut iteration = GammaIteration::new(plant, &innovations)?;
    iteration.start_from(innovations.iter().filter_map(Innovations::h2))?;
    let optimum = iteration.best().map_err(|_| DesignError::RiccatiFailed { gamma: f64::INFINITY })?;
    Ok(iteration.synthesis(optimum))
}
