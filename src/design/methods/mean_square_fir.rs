//! The FIR bank with the least mean-square error of all banks of its length, for white noise at the analog
//! input and the noise of the converters.
//!
//! The phases of the output do not depend on one another: phase p estimates the target at the instant p - m0
//! from the newest `J_p = ceil((taps - p) / M)` frames.

use super::{Settings, Synthesis};
use crate::design::DesignError;
use crate::design::history_errors::best_taps;
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use std::ops::RangeInclusive;

/// Noise of a sample relative to its size, below which the noise of a converter counts as this: samples that
/// determine one another up to rounding are weighed alike, and not as huge differences.
const INNOVATION_ROUNDING: f64 = 1e-13;

/// The `settings.taps` taps per channel with the least `||K||_2^2 + sum_i noise_i ||f_i||^2`.
///
/// # Errors
/// [`DesignError::Lti`] for unstable plants.
pub(crate) fn synthesise(plant: &LiftedPlant, settings: &Settings) -> Result<Synthesis, DesignError> {
    let problem = with_rounding(plant)?;
    let best = |frames, instants| best_taps(&problem, frames, instants);
    Synthesis::of_taps(plant, of_phases(&problem, settings.taps, best)?)
}

/// The taps `[i][n]` of so many per channel from those of each phase: `best(frames, instants)[k][i][j]`
/// weighs sample j of channel i for the target at the k-th of the instants.
///
/// # Errors
/// Those of `best`.
pub(super) fn of_phases(
    problem: &Problem,
    length: usize,
    best: impl Fn(usize, RangeInclusive<i64>) -> Result<Vec<Vec<Vec<f64>>>, DesignError>,
) -> Result<Vec<Vec<f64>>, DesignError> {
    let ratio = problem.ratio;
    let mut taps = vec![vec![0.0; length]; problem.channels.len()];
    // The first phases have a lag more than the others, unless all have equally many.
    let longer = length % ratio;
    for (phases, frames) in [(0..longer, length / ratio + 1), (longer..ratio, length / ratio)] {
        if phases.is_empty() || frames == 0 {
            continue;
        }
        let instant = |p: usize| p as i64 - problem.latency as i64;
        let found = best(frames, instant(phases.start)..=instant(phases.end - 1))?;
        for (p, filters) in phases.zip(found) {
            for (tap, lags) in taps.iter_mut().zip(filters) {
                lags.iter().enumerate().for_each(|(j, weight)| tap[p + j * ratio] = *weight);
            }
        }
    }
    Ok(taps)
}

/// The problem with at least the noise of rounding.
pub(super) fn with_rounding(plant: &LiftedPlant) -> Result<Problem, DesignError> {
    let mut problem = plant.problem().clone();
    let sizes = problem.measurement_sizes()?;
    for (power, size) in problem.noise.iter_mut().zip(sizes) {
        *power = power.max((INNOVATION_ROUNDING * size).powi(2));
    }
    Ok(problem)
}

#[cfg(test)]
mod tests;
