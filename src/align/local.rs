//! The lag between two recordings in one piece, by its correlation.

use crate::calibrate::{Correlation, Record, stretch};
use crate::linalg::fourier;

/// Another lag whose correlation has this share of the highest one says as much as that.
const ALIKE_CORRELATION: f64 = 0.9;
/// Samples from the highest correlation within which all others belong to its peak.
const PEAK_SAMPLES: usize = 2;

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
        // The vertex of the parabola through three values.
        let [before, at, after] = [best - 1, best, best + 1].map(|n| sums[n]);
        let part = 0.5 * (before - after) / (before - 2.0 * at + after);
        let part = if part.abs() <= 0.5 { part } else { 0.0 };
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
