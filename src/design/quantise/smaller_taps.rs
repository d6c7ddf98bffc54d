//! Real taps that are smaller than the optimal ones and cost some gamma. Few bits hold them with a finer
//! step.

use super::problem::TapError;
use crate::design::DesignError;
use crate::design::filters::{impulse_responses, polyphase};
use crate::design::methods::tap_lags;
use crate::lmi::sampled::{MeanSquareObjective, Problem, mean_square_under_cap};

/// gamma of the smaller taps over that of the optimal ones, in decibels.
const LOSSES_DB: [f64; 12] = [0.02, 0.1, 0.3, 1.0, 2.0, 4.0, 7.0, 11.0, 16.0, 24.0, 36.0, 60.0];
/// Weight of the mean-square error relative to that of the taps.
const ERROR_WEIGHT: f64 = 1e-6;
/// Relative accuracy.
const ACCURACY: f64 = 1e-3;

/// Taps with the gamma that they were allowed.
pub(super) struct SmallerTaps {
    pub(super) gamma: f64,
    pub(super) taps: Vec<Vec<f64>>,
}

/// For each of some gammas below that of zero output the taps of least Euclidean norm, the largest taps
/// first.
///
/// # Errors
/// [`DesignError::Linalg`] if a decomposition fails.
pub(super) fn smaller_taps(error: &TapError<'_>) -> Result<Vec<SmallerTaps>, DesignError> {
    let zero_output = zero_output(error);
    let caps = LOSSES_DB.map(|db| error.real_gamma * 10f64.powf(db / 20.0));
    caps.into_iter()
        .take_while(|cap| *cap < zero_output)
        .map_while(|cap| under_cap(error, cap).transpose())
        .collect()
}

/// An upper bound of the gamma of zero taps.
fn zero_output(error: &TapError<'_>) -> f64 {
    error.points.iter().map(|point| point.w.norm()).fold(0.0, f64::max)
}

/// `None` if gamma is zero up to rounding: no cap lies above it.
fn under_cap(error: &TapError<'_>, cap: f64) -> Result<Option<SmallerTaps>, DesignError> {
    let (length, channels) = (error.problem.taps[0].len(), error.problem.taps.len());
    let (points, mut weights) = error.grid.coarse(0);
    weights.iter_mut().for_each(|weight| *weight *= ERROR_WEIGHT);
    let lags = tap_lags(error.ratio, length);
    let problem = Problem::new(points, lags);
    let objective = MeanSquareObjective { weights, noise: vec![1.0; channels] };
    let start = polyphase(error.problem.taps, error.ratio);
    let is_due = || error.problem.stop.is_due();
    let found = mean_square_under_cap(&problem, &objective, cap, &start, ACCURACY, &is_due)?;
    Ok(found.map(|found| SmallerTaps { gamma: cap, taps: impulse_responses(&found.taps, length) }))
}
