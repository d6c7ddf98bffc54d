//! How well samples are predicted from those around them: a trial of a model by the recordings themselves.

use super::around::Around;
use super::estimator::{Estimator, TimedSample};
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::{LinalgError, Mat, PositiveFactor, dot};
use rayon::prelude::*;

/// The least power of a signal over its mean power.
const LEAST_LEVEL: f64 = 1e-6;

/// A sample that was left out and estimated from the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// Of which converter.
    pub converter: usize,
    /// The sample less its estimate.
    pub residual: f64,
    /// The variance that the model states for the residual, for a signal of mean power 1 that has the power
    /// of the samples around.
    pub variance: f64,
}

/// At some instants the nearest sample of every recording, which is left out in turn, and the samples around
/// that predict it. Their covariances are computed once, for whatever noise.
#[derive(Debug, Clone)]
pub struct Trials {
    trials: Vec<HeldOutSamples>,
}

#[derive(Debug, Clone)]
struct HeldOutSamples {
    samples: Vec<TimedSample>,
    values: Vec<f64>,
    /// Those that are left out.
    nearest: Vec<usize>,
    /// The power around over the mean power.
    level: f64,
    /// C without noise, its lower triangle.
    signal: Mat,
}

impl Trials {
    /// At `instants`, with `reach` samples of each recording on either side. `power` is the mean power of
    /// the signal.
    pub fn new(
        estimator: &Estimator,
        recordings: &[Recording],
        reach: usize,
        power: f64,
        instants: &[FastPeriods],
    ) -> Self {
        let trial =
            |instant: &FastPeriods| HeldOutSamples::new(estimator, recordings, reach, power, *instant);
        Self { trials: instants.par_iter().map(trial).collect() }
    }

    /// The samples that were left out, for converters with these variances of their noise.
    ///
    /// With the covariances C of all samples x around an instant, the residual of sample k is
    /// `[C^-1 x]_k / [C^-1]_kk` and its variance `1 / [C^-1]_kk` (Rasmussen and Williams, Gaussian Processes
    /// for Machine Learning, section 5.4.2).
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub fn held_out(&self, noise: &[f64]) -> Result<Vec<HeldOut>, LinalgError> {
        let parts: Vec<Vec<HeldOut>> =
            self.trials.par_iter().map(|trial| trial.held_out(noise)).collect::<Result<_, _>>()?;
        Ok(parts.concat())
    }
}

impl HeldOutSamples {
    fn new(
        estimator: &Estimator,
        recordings: &[Recording],
        reach: usize,
        power: f64,
        origin: FastPeriods,
    ) -> Self {
        let within = estimator.signals().longest() * 0.5;
        let around = Around::new(recordings, origin..origin, reach, within);
        let (nearest, Around { samples, values, .. }) = (around.nearest(), around);
        // Sounds come and go, noise stays.
        let gain = |sample: &TimedSample| estimator.signals().converters()[sample.converter].gain;
        let squares = samples.iter().zip(&values).map(|(sample, value)| (value / gain(sample)).powi(2));
        let level = squares.sum::<f64>() / (values.len().max(1) as f64 * power);
        let signal = estimator.signal_covariances(&samples);
        Self { nearest, level: level.max(LEAST_LEVEL), signal, samples, values }
    }

    fn held_out(&self, noise: &[f64]) -> Result<Vec<HeldOut>, LinalgError> {
        let Self { samples, values, nearest, level, signal } = self;
        if nearest.is_empty() {
            return Ok(Vec::new());
        }
        let mut covariances = signal.clone();
        for (k, sample) in samples.iter().enumerate() {
            covariances[(k, k)] += noise[sample.converter] / level;
        }
        let unit =
            Mat::from_fn(samples.len(), nearest.len(), |k, column| f64::from(u8::from(nearest[column] == k)));
        let columns = PositiveFactor::new(&covariances)?.solve(&unit);
        let found = |(column, &k): (usize, &usize)| {
            let of_inverse = &columns.as_slice()[column * samples.len()..(column + 1) * samples.len()];
            HeldOut {
                converter: samples[k].converter,
                residual: dot(of_inverse, values) / of_inverse[k],
                variance: level / of_inverse[k],
            }
        };
        Ok(nearest.iter().enumerate().map(found).collect())
    }
}
