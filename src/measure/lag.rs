//! The whole part of a lag, from the correlation of two recordings.

use crate::linalg::{Complex, fourier};

/// Samples of each recording from which the whole part of the lag is found.
const SEARCHED: usize = 1 << 20;
/// Least part of the shorter recording that overlaps at a lag.
const LEAST_PART: usize = 2;
/// Lags whose correlation is this close to the largest are tried: the correlation at whole samples is below
/// that at the lag itself.
const LIKELY: f64 = 0.8;
/// Coefficients that differ by less than this share are one: the noise of the recordings makes such
/// differences between periods of a signal.
const ALIKE: f64 = 1e-3;
/// Lags that are tried: so many of the largest correlation, and of those that exceed all nearer to 0.
const MOST_LAGS: usize = 8;

/// The lags of the largest correlation coefficients in absolute value, in whole samples, and those with a
/// larger coefficient than all that are nearer to 0: among the many lags that agree for a periodic signal
/// they hold the shortest.
pub(super) fn likely_lags(samples: &[f64], reference: &[f64]) -> Vec<i64> {
    let (x, r) = (deviations(samples), deviations(reference));
    let size = (x.len() + r.len()).next_power_of_two();
    let padded = |values: &[f64]| {
        let mut padded = vec![Complex::ZERO; size];
        padded.iter_mut().zip(values).for_each(|(slot, value)| slot.re = *value);
        padded
    };
    let mut turned = padded(&r);
    turned[1..].reverse();
    let correlation = fourier::circular_convolution(padded(&x), turned);
    let (energies, others) = (sums_of_squares(&x), sums_of_squares(&r));
    let least = x.len().min(r.len()) / LEAST_PART;
    let coefficient = |lag: i64| {
        let first = lag.max(0) as usize;
        let last = (r.len() as i64 + lag).clamp(0, x.len() as i64) as usize;
        if last < first + least.max(1) {
            return 0.0;
        }
        let own = energies[last] - energies[first];
        let other = others[(last as i64 - lag) as usize] - others[(first as i64 - lag) as usize];
        let covariance = correlation[lag.rem_euclid(size as i64) as usize].re / size as f64;
        // An overlap of zeros correlates with nothing.
        if own > 0.0 && other > 0.0 { covariance.abs() / (own * other).sqrt() } else { 0.0 }
    };
    let lags = 1 - r.len() as i64..x.len() as i64;
    let all: Vec<f64> = lags.clone().map(coefficient).collect();
    let largest = all.iter().fold(0.0, |most: f64, c| most.max(*c));
    let is_peak = |i: usize| {
        let below = |j: Option<usize>| j.and_then(|j| all.get(j)).is_none_or(|c| *c <= all[i]);
        all[i] >= LIKELY * largest && below(i.checked_sub(1)) && below(Some(i + 1))
    };
    let peaks = lags.enumerate().filter(|(i, _)| is_peak(*i));
    let mut peaks: Vec<(f64, i64)> = peaks.map(|(i, lag)| (all[i], lag)).collect();
    peaks.sort_by_key(|(_, lag)| lag.abs());
    let mut rising: Vec<(f64, i64)> = Vec::new();
    for peak in &peaks {
        if rising.last().is_none_or(|last| peak.0 > last.0 * (1.0 + ALIKE)) {
            rising.push(*peak);
        }
    }
    let shortest = rising.into_iter().rev().take(MOST_LAGS).map(|(_, lag)| lag);
    let mut lags: Vec<i64> = shortest.collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    lags.extend(peaks.into_iter().take(MOST_LAGS).map(|(_, lag)| lag));
    lags.sort_by_key(|lag| lag.abs());
    lags.dedup();
    lags
}

/// Sums of the squares of the first 0, 1, 2, .. values.
fn sums_of_squares(values: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let next = values.iter().map(|x| {
        sum += x * x;
        sum
    });
    std::iter::once(0.0).chain(next).collect()
}

/// The first [`SEARCHED`] samples without their mean; 0 where one is missing.
fn deviations(samples: &[f64]) -> Vec<f64> {
    let samples = &samples[..samples.len().min(SEARCHED)];
    let finite = || samples.iter().filter(|x| x.is_finite());
    let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
    samples.iter().map(|x| if x.is_finite() { x - mean } else { 0.0 }).collect()
}
