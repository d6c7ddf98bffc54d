//! What each channel can do for itself: its own gain and its own skew are taken from its samples, and the
//! other channels count as exact.
//!
//! The samples in turn are taken for uniform ones. A filter of [`TAPS`] of them, one for each channel, moves
//! a sample by the skew of its channel. It is the best one in the band, so what is left of an image is of
//! second order in the skews: the neighbours that the filter uses have skews too.

use crate::design::{Problem, nearest_samples};
use hybank_core::units::CyclesPerFastPeriod;
use hybank_linalg::{CMat, Complex, Mat};
use std::f64::consts::TAU;

/// Samples that a correction uses.
pub(crate) const TAPS: usize = 32;
/// Noise in the least squares of the filters, relative to the signal: it bounds their gain outside the band.
const RIDGE: f64 = 1e-9;

/// Corrected samples in turn.
pub(super) struct Correction {
    channels: usize,
    /// One list for each output phase.
    outputs: Vec<Vec<CorrectionTap>>,
}

/// The weight of the sample of a channel, `lag` frames old.
struct CorrectionTap {
    channel: usize,
    lag: i64,
    weight: f64,
}

impl Correction {
    /// With samples of all time, for signals in a band; `None` unless each output sample has one slow sample
    /// of its own, of several channels.
    pub(super) fn new(problem: &Problem, band: [CyclesPerFastPeriod; 2]) -> Option<Self> {
        let Problem { ratio, latency, channels, .. } = problem;
        if channels.len() != *ratio || channels.len() == 1 {
            return None;
        }
        let (delays, period) = (problem.delays(), *ratio as i64);
        let nearest = nearest_samples(&delays, *ratio, *latency, i64::MIN);
        let output = |p: usize| -> Option<Vec<CorrectionTap>> {
            let own = nearest[p];
            let instant = p as f64 - *latency as f64;
            let skew = instant + (own.lag * period) as f64 + delays[own.channel].0;
            let taps = shifts().zip(weights(skew, band)?).map(|(shift, weight)| {
                let index = p as i64 + shift;
                let sample = nearest[index.rem_euclid(period) as usize];
                let lag = sample.lag - index.div_euclid(period);
                let weight = weight / channels[sample.channel].converter_gain;
                CorrectionTap { channel: sample.channel, lag, weight }
            });
            Some(taps.collect())
        };
        let outputs = (0..*ratio).map(output).collect::<Option<_>>()?;
        Some(Self { channels: channels.len(), outputs })
    }

    /// F at the angle theta.
    pub(super) fn at(&self, theta: f64) -> CMat {
        let mut filters = CMat::zeros(self.outputs.len(), self.channels);
        for (p, taps) in self.outputs.iter().enumerate() {
            for CorrectionTap { channel, lag, weight } in taps {
                filters[(p, *channel)] += Complex::from_polar(*weight, -theta * *lag as f64);
            }
        }
        filters
    }
}

/// Places of the samples relative to the one that is moved.
fn shifts() -> impl Iterator<Item = i64> {
    let half = TAPS as i64 / 2;
    1 - half..=half
}

/// Weights of uniform samples that give the signal `skew` after one of them: that sample, and what moves it
/// by least squares over the band, the sum of c_l e^{j w l} against e^{j w skew} - 1.
fn weights(skew: f64, [low, high]: [CyclesPerFastPeriod; 2]) -> Option<Vec<f64>> {
    let width = high.0 - low.0;
    let covariance = |t: f64| match TAU * t {
        0.0 => width,
        x => ((x * high.0).sin() - (x * low.0).sin()) / x,
    };
    let shifts: Vec<f64> = shifts().map(|shift| shift as f64).collect();
    let mut normal = Mat::from_fn(TAPS, TAPS, |i, j| covariance(shifts[i] - shifts[j]));
    (0..TAPS).for_each(|i| normal[(i, i)] += RIDGE * width);
    let wanted = Mat::from_fn(TAPS, 1, |i, _| covariance(skew - shifts[i]) - covariance(shifts[i]));
    let moves = hybank_linalg::solve_positive(&normal, &wanted).ok()?;
    Some(shifts.iter().zip(moves.iter()).map(|(shift, c)| if *shift == 0.0 { 1.0 + c } else { *c }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tone in the band, half a thousandth of a sample from its place.
    #[test]
    fn a_sample_is_moved_by_its_skew() {
        for (skew, band) in [(0.01, [0.0, 0.37]), (-0.02, [0.55, 0.9]), (0.0, [0.0, 0.3])] {
            let weights = weights(skew, band.map(CyclesPerFastPeriod)).unwrap();
            for part in [0.05, 0.5, 0.95] {
                let w = TAU * (band[0] + part * (band[1] - band[0]));
                let terms = shifts().zip(&weights).map(|(l, c)| Complex::from_polar(*c, w * l as f64));
                let error = terms.sum::<Complex<f64>>() - Complex::from_polar(1.0, w * skew);
                assert!(error.norm() < 5e-3 * skew.abs() + 1e-6, "{skew} {part}: {error}");
            }
        }
    }
}
