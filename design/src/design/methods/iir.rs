//! The bank with the least gamma of all causal banks, by a-posteriori H-infinity filtering and
//! gamma-iteration (thesis 5.3).

use super::filtering::{Innovations, ReferenceFilter, RiccatiSolver, Trial};
use super::gamma_iteration::{EvaluatedFilters, GammaIteration};
use super::precise_filtering::PreciseFiltering;
use super::{MethodSettings, Synthesis};
use crate::design::DesignError;
use crate::design::limits::{MOST_STATES_AT_106_BITS, MOST_STATES_AT_512_BITS};
use crate::design::plant::LiftedPlant;
use hybank_verify::arithmetic::{DoubleDouble, Float, Float512};
use std::rc::Rc;

/// Shares of the converters' noise that a central filter may count, the largest that keeps gamma first.
const NOISE_SHARES: [f64; 6] = [1.0, 0.5, 0.25, 0.1, 0.03, 0.01];

/// The least gamma within [`GAMMA_ACCURACY`](super::GAMMA_ACCURACY); with `settings.gamma_margin` > 0 a
/// filter with at most (1 + margin) times the optimum instead, which has the smaller mean square of error
/// and noise: the mean-square optimum if its gamma is that small, else a central filter.
///
/// # Errors
/// [`DesignError::RiccatiFailed`] if no Riccati equation could be solved, [`DesignError::Lti`] if the plant
/// is not stable.
pub(crate) fn synthesise(plant: &LiftedPlant, settings: &MethodSettings) -> Result<Synthesis, DesignError> {
    let innovations = Innovations::in_all_coordinates(plant)?;
    let mut iteration = GammaIteration::new(plant, &innovations, &settings.stop)?;
    iteration.start_from(innovations.iter().filter_map(|form| form.h2()))?;
    iteration.try_the_lower_bound()?;
    iteration.bisect()?;
    refine::<DoubleDouble>(plant, &mut iteration, MOST_STATES_AT_106_BITS)?;
    refine::<Float512>(plant, &mut iteration, MOST_STATES_AT_512_BITS)?;
    let optimum = iteration.best()?;
    let relaxed = relaxed(plant, &mut iteration, &optimum, settings.gamma_margin.unwrap_or(0.0))?;
    Ok(iteration.synthesis(relaxed.unwrap_or(optimum)))
}

/// Goes on in the precision of `F` where the search so far left the optimum open, for plants of at most
/// `limit` states.
fn refine<F: Float>(
    plant: &LiftedPlant,
    iteration: &mut GammaIteration<'_>,
    limit: usize,
) -> Result<(), DesignError> {
    if iteration.is_stopped() || iteration.attains_a_bound() || plant.system().order() > limit {
        return Ok(());
    }
    let solver = Rc::new(PreciseFiltering::<F>::new(plant)?);
    if iteration.is_confirmed_by(solver.as_ref()) {
        return Ok(());
    }
    iteration.go_on_with(solver);
    iteration.bisect()
}

/// A filter whose norm is within `margin` of the optimum and which has less error and noise, if a margin is
/// given and one is found.
fn relaxed(
    plant: &LiftedPlant,
    iteration: &mut GammaIteration<'_>,
    optimum: &EvaluatedFilters,
    margin: f64,
) -> Result<Option<EvaluatedFilters>, DesignError> {
    if margin <= 0.0 || iteration.is_stopped() || iteration.is_negligible(optimum.peak.gain) {
        return Ok(None);
    }
    let cap = optimum.peak.gain * (1.0 + margin);
    if plant.has_noise()
        && let Some(found) = relaxed_with_noise(plant, iteration, cap)?
    {
        return Ok(Some(found));
    }
    for solver in iteration.solvers() {
        let Trial::Achieved(filters) = solver.h_infinity(cap) else { continue };
        if let Some(found) = within(iteration, filters, cap)? {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// Central filters of the plant with noise: their gamma for signal and noise together is at most `cap`, so
/// that of the signal is too. The more noise counts, the less of it is left.
fn relaxed_with_noise(
    plant: &LiftedPlant,
    iteration: &mut GammaIteration<'_>,
    cap: f64,
) -> Result<Option<EvaluatedFilters>, DesignError> {
    for share in NOISE_SHARES {
        let noisy = plant.with_noise_scaled(share);
        for form in Innovations::in_all_coordinates(&noisy)? {
            let mean_square = if share == 1.0 { form.h2() } else { None };
            let central = match form.h_infinity(cap) {
                Trial::Achieved(filters) => Some(filters),
                _ => None,
            };
            for filters in mean_square.into_iter().chain(central) {
                if let Some(found) = within(iteration, filters, cap)? {
                    return Ok(Some(found));
                }
            }
        }
    }
    Ok(None)
}

/// The filters with their norm, if it is at most `cap`.
fn within(
    iteration: &mut GammaIteration<'_>,
    filters: ReferenceFilter,
    cap: f64,
) -> Result<Option<EvaluatedFilters>, DesignError> {
    Ok(iteration.evaluate(filters)?.filter(|found| found.peak.gain <= cap))
}
