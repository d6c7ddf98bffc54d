//! The lag between two recordings in one piece, by its correlation.

use crate::calibrate::{Correlation, Record, stretch};
use crate::linalg::{Complex, fourier};
use std::f64::consts::PI;

/// Another lag whose correlation has this share of the highest one says as much as that.
const ALIKE_CORRELATION: f64 = 0.9;
/// Samples from the highest correlation within which all others belong to its peak.
const PEAK_SAMPLES: usize = 2;

/// Signals whose neighbouring samples correlate less are white up to half the rate: they may well go beyond
/// it.
const WHITE_CORRELATION: f64 = 0.5;
/// Lags on each side of the highest correlation whose spectrum has the phase.
const PHASE_LAGS: i32 = 16;
/// Frequencies at which it is looked at, up to a quarter of half the rate: what lies beyond half the rate
/// comes there last.
const PHASE_FREQUENCIES: i32 = 8;
const LOW_FREQUENCY: f64 = PI / 4.0;
/// Share of the spectrum of white noise of the same correlation that low frequencies have at least.
const LEAST_LOW: f64 = 0.5;

/// Where a piece of the reference is looked for in another recording.
#[derive(Debug, Clone, Copy)]
pub(super) struct SearchWindow {
    /// Its samples in the reference.
    pub(super) first: usize,
    pub(super) length: usize,
    /// The lag, and by how many samples it may differ.
    pub(super) expected: f64,
    pub(super) margin: usize,
}

/// What the correlation in one piece says of the lag of a recording.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalLag {
    /// Samples beyond the expected lag.
    pub(super) beyond: f64,
    /// Share of the largest possible correlation, with its sign.
    pub(super) height: f64,
    /// Logarithm of the odds that a correlation of chance is smaller.
    pub(super) odds: f64,
    /// No other lag says as much.
    pub(super) is_alone: bool,
}

impl LocalLag {
    pub(super) fn new(reference: &Record, other: &Record, place: SearchWindow) -> Self {
        let SearchWindow { first, length, expected, margin } = place;
        let size = (length + 2 * margin).next_power_of_two();
        let begin = first as i64 + expected.round() as i64 - margin as i64;
        let mut around = stretch(other, begin, length + 2 * margin);
        around.resize(size, 0.0);
        let own = stretch(reference, first as i64, length);
        let sums = Correlation::with(&own, size).of(&fourier::real_spectrum(&around));
        let shifts = 1..2 * margin;
        let best = shifts.clone().max_by(|a, b| sums[*a].abs().total_cmp(&sums[*b].abs())).unwrap_or(margin);
        let at = sums[best];
        let by_phase = if is_white(&own) { phase_lag(&sums, best) } else { None };
        let part = by_phase.unwrap_or_else(|| vertex(&sums, best));
        let lag = (begin + best as i64 - first as i64) as f64 + part;
        let height = |n: usize| sums[n].abs();
        let is_peak = |n: usize| height(n) >= height(n - 1).max(height(n + 1));
        let is_rival = |n: usize| {
            n.abs_diff(best) > PEAK_SAMPLES && is_peak(n) && height(n) >= ALIKE_CORRELATION * height(best)
        };
        let chance = sums.iter().map(|sum| sum * sum).sum::<f64>() / size as f64;
        let odds = if chance > 0.0 { 0.5 * at * at / chance } else { 0.0 };
        Self { beyond: lag - expected, height: at, odds, is_alone: !shifts.clone().any(is_rival) }
    }
}

/// Whether neighbouring samples hardly correlate.
fn is_white(samples: &[f64]) -> bool {
    let power: f64 = samples.iter().map(|x| x * x).sum();
    let beside: f64 = samples.windows(2).map(|pair| pair[0] * pair[1]).sum();
    beside < WHITE_CORRELATION * power
}

/// The vertex of the parabola through three values, in samples beyond the middle one.
fn vertex(sums: &[f64], best: usize) -> f64 {
    let [before, at, after] = [best - 1, best, best + 1].map(|n| sums[n]);
    let part = 0.5 * (before - after) / (before - 2.0 * at + after);
    if part.abs() <= 0.5 { part } else { 0.0 }
}

/// The delay that low frequencies have beyond the highest correlation, by their phases. `None` if little of
/// the signal is there.
///
/// A signal that goes beyond half the rate folds back, and two recordings of it differ there by more than a
/// delay. Their correlation has its peak at whole samples, whatever the delay is between.
fn phase_lag(sums: &[f64], best: usize) -> Option<f64> {
    let size = sums.len() as i64;
    let value = |k: i32| sums[(best as i64 + i64::from(k)).rem_euclid(size) as usize] * sums[best].signum();
    let window = |k: i32| (0.5 * PI * f64::from(k) / f64::from(PHASE_LAGS + 1)).cos().powi(2);
    let spectrum = |w: f64| -> Complex<f64> {
        (-PHASE_LAGS..=PHASE_LAGS).map(|k| Complex::from_polar(value(k) * window(k), -w * f64::from(k))).sum()
    };
    let (mut phases, mut weights, mut power) = (0.0, 0.0, 0.0);
    for k in 1..=PHASE_FREQUENCIES {
        let w = LOW_FREQUENCY * f64::from(k) / f64::from(PHASE_FREQUENCIES);
        let found = spectrum(w);
        phases -= found.norm_sqr() * w * found.arg();
        weights += found.norm_sqr() * w * w;
        power += found.norm_sqr() / f64::from(PHASE_FREQUENCIES);
    }
    (power > (LEAST_LOW * sums[best]).powi(2)).then(|| (phases / weights).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Noise between two frequencies in radians per sample, later by `delay` samples: a sum of many tones.
    fn noise(low: f64, high: f64, delay: f64) -> Record {
        let mut random = Random(5);
        let mut tone = || [low + (high - low) * random.part(), 2.0 * PI * random.part()];
        let tones: Vec<[f64; 2]> = (0..3000).map(|_| tone()).collect();
        let at = |n: usize| tones.iter().map(|[w, phase]| (w * (n as f64 - delay) + phase).cos()).sum();
        Record::new((0..2600).map(at).collect())
    }

    const PLACE: SearchWindow = SearchWindow { first: 200, length: 2048, expected: 3.0, margin: 20 };

    #[test]
    fn a_lag_between_samples_is_found_in_noise_beyond_half_the_rate() {
        let reference = noise(0.0, 1.7 * PI, 0.0);
        for delay in [3.0, 3.2, 3.4, 3.6, 3.8] {
            let found = LocalLag::new(&reference, &noise(0.0, 1.7 * PI, delay), PLACE);
            assert!((found.beyond + 3.0 - delay).abs() < 0.1, "{delay}: {}", found.beyond);
        }
    }

    /// Low frequencies of which there are none say nothing.
    #[test]
    fn a_lag_is_found_in_a_band_without_low_frequencies() {
        let reference = noise(0.35 * PI, 0.9 * PI, 0.0);
        for delay in [3.0, 3.1, 3.2] {
            let found = LocalLag::new(&reference, &noise(0.35 * PI, 0.9 * PI, delay), PLACE);
            assert!((found.beyond + 3.0 - delay).abs() < 0.1, "{delay}: {}", found.beyond);
        }
    }
}
