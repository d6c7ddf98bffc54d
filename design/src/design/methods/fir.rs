//! FIR design: the taps of least gamma (thesis 5.4), and among these the ones of least mean-square error.
//!
//! The bounded-real LMI of thesis 5.4 in the frequency domain is the semi-infinite problem min over taps of
//! max over w of sigma_max(W(w) - F(w) H(w)), which [`Exchange`] solves: its lower bound holds for all taps
//! of that length. The norm of the taps found is the upper bound. While taps still change, their norm is
//! only estimated, from the peaks between the points of a fine grid; the taps that are returned have the
//! computed one.

use super::{GAMMA_ACCURACY, MethodSettings, Synthesis, tap_lags};
use crate::design::DesignError;
use crate::design::error_grid::{ErrorGrid, GridFrequency};
use crate::design::exchange::{self, Exchange};
use crate::design::plant::LiftedPlant;
use crate::lmi::sampled::{MeanSquareObjective, SampledProblem};
use crate::lti::peak::Peak;

/// Default relative margin of gamma that may be spent on less noise at the output, if the converters' noise
/// is known.
const NOISY_MARGIN: f64 = 1e-3;
/// Limit on the number of times that the norm finds a peak which the estimates missed.
const MISSED_PEAK_LIMIT: usize = 8;

/// The `settings.taps` taps per channel of least gamma within [`GAMMA_ACCURACY`]. Optimal banks are not
/// unique. Of all banks within the gamma margin, this function returns the one with the least power per
/// slow period, summed over the error for white noise of unit density at the analog input and the
/// converters' noise at the output: `||K||_2^2 + sum_i noise_i ||f_i||^2`.
///
/// # Errors
/// [`DesignError::Lti`] for unstable plants; [`DesignError::Linalg`] if a decomposition fails.
pub(crate) fn synthesise(plant: &LiftedPlant, settings: &MethodSettings) -> Result<Synthesis, DesignError> {
    let mut exchange = exchange(plant, settings)?;
    let best = least_gamma(plant, settings.taps, &mut exchange)?;
    Synthesis::of_least_gamma(plant, best.taps, best.peak, exchange.lower)
}

/// The taps of [`synthesise`] alone.
///
/// # Errors
/// As [`synthesise`].
pub(super) fn taps_of_least_gamma(
    plant: &LiftedPlant,
    settings: &MethodSettings,
) -> Result<Vec<Vec<f64>>, DesignError> {
    Ok(least_gamma(plant, settings.taps, &mut exchange(plant, settings)?)?.taps)
}

fn exchange<'a>(
    plant: &'a LiftedPlant,
    settings: &MethodSettings,
) -> Result<Exchange<ErrorGrid<'a>>, DesignError> {
    let lags = tap_lags(plant.ratio(), settings.taps);
    let grid = ErrorGrid::new(plant, lags[0])?;
    let (points, weights) = grid.coarse();
    let noise = plant.problem().noise.clone();
    let margin = settings.gamma_margin.unwrap_or_else(|| usual_margin(&noise));
    let objective = MeanSquareObjective { weights, noise };
    let problem = SampledProblem::new(points, lags);
    let mut exchange = Exchange::new(grid, problem, std::iter::repeat(()), objective, margin);
    exchange.stop = settings.stop.clone();
    Ok(exchange)
}

/// 1e-3 if a channel has noise, else the least possible margin.
fn usual_margin(noise: &[f64]) -> f64 {
    if noise.iter().any(|power| *power > 0.0) { NOISY_MARGIN } else { exchange::SETTINGS.least_margin }
}

/// Taps with their norm.
struct EvaluatedTaps {
    taps: Vec<Vec<f64>>,
    /// Their norm, estimated on the grid.
    estimate: f64,
    peak: Peak,
}

impl EvaluatedTaps {
    /// Whether the grid missed the peak of the norm.
    fn is_missed(&self) -> bool {
        self.peak.gain > self.estimate * (1.0 + GAMMA_ACCURACY)
    }
}

/// The exchange. If the grid missed the peak of the norm, the exchange is repeated with that peak as a
/// further point.
fn least_gamma(
    plant: &LiftedPlant,
    length: usize,
    exchange: &mut Exchange<ErrorGrid<'_>>,
) -> Result<EvaluatedTaps, DesignError> {
    let mut best = judged(plant, length, exchange)?;
    for _ in 0..MISSED_PEAK_LIMIT {
        if !best.is_missed()
            || exchange.stop.is_due()
            || !exchange.add(&[GridFrequency { frequency: best.peak.frequency, scenario: () }])
        {
            break;
        }
        let other = judged(plant, length, exchange)?;
        if other.peak.gain < best.peak.gain {
            best = other;
        }
    }
    Ok(best)
}

fn judged(
    plant: &LiftedPlant,
    length: usize,
    exchange: &mut Exchange<ErrorGrid<'_>>,
) -> Result<EvaluatedTaps, DesignError> {
    let found = exchange.optimise()?;
    let taps = found.taps.impulse_responses(length);
    let peak = plant.fir_norm(&taps)?;
    Ok(EvaluatedTaps { taps, estimate: found.estimate, peak })
}
