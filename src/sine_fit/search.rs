//! Tones from the peaks of spectra: the start of a fit.

use super::gauss_newton::fit;
use super::{Channel, SineFitError, alias};
use crate::linalg::fourier;
use crate::units::{Decibels, Hertz};
use std::f64::consts::{LN_2, TAU};
use std::ops::Range;

/// A peak is a tone if its power is this many times ln(bins) times the mean noise power per bin. The largest
/// of B bins of Gaussian noise exceeds c ln B times the mean with probability B^(1-c).
const SIGNIFICANCE: f64 = 4.0;
/// A peak below this share of the largest sample is the rounding of the transform.
const TRANSFORM_ROUNDING: f64 = 1e-13;
/// Lines that are named where a tone is missing, and how far below the largest.
const NAMED_LINES: usize = 5;
const NAMED_RANGE: Decibels = Decibels(60.0);
/// Half the width of the main lobe of a Hann window in bins.
const LOBE: usize = 2;

/// The frequencies of the largest tones in 0 to half the rate, largest first: at most `most`, none more than
/// `range` below the first. They are fitted jointly, and each further one is searched for in what the fit of
/// those before it leaves, so a small tone in the leakage of a large one is found as well.
///
/// Channels are searched together; they have one rate. Samples that are not finite count as the mean, and
/// masked ones take part: a clipped sine has the frequency of the sine.
///
/// # Errors
/// [`SineFitError::NoTone`] if no peak stands out, and the errors of a fit of the first tone.
pub fn find_tones(
    channels: &[Channel<'_>],
    rate: Hertz,
    most: usize,
    range: Decibels,
) -> Result<Vec<Hertz>, SineFitError> {
    let mut tones: Vec<Hertz> = Vec::new();
    let mut records: Vec<Vec<f64>> = channels.iter().map(|channel| channel.samples.to_vec()).collect();
    let largest = Power::of(&records).largest;
    while tones.len() < most {
        let power = Power::of(&records);
        let Some(cycles) = power.maximum(0.0..0.5, largest) else { break };
        let starts: Vec<Hertz> = tones.iter().copied().chain([rate * cycles]).collect();
        let found = match fit(channels, rate, &starts) {
            Err(error) if tones.is_empty() => return Err(error),
            Err(_) => break,
            Ok(found) => found,
        };
        let size = |k: usize| found.channels.iter().map(|c| c.tones[k].amplitude.value.powi(2)).sum::<f64>();
        if Decibels::of_power(size(tones.len()) / size(0)) < -range {
            break;
        }
        tones = found.frequencies.iter().map(|f| f.value).collect();
        records = channels.iter().enumerate().map(|(i, c)| found.residual(i, c.samples)).collect();
    }
    if tones.is_empty() { Err(SineFitError::NoTone { near: None, lines: Vec::new() }) } else { Ok(tones) }
}

/// The start for a fit of the tone near `near`, in any Nyquist zone: the largest peak whose alias is within
/// `within` of that of `near`.
///
/// # Errors
/// [`SineFitError::NoTone`] if no peak stands out there.
pub fn locate(
    channels: &[Channel<'_>],
    rate: Hertz,
    near: Hertz,
    within: Hertz,
) -> Result<Hertz, SineFitError> {
    let records: Vec<Vec<f64>> = channels.iter().map(|channel| channel.samples.to_vec()).collect();
    let power = Power::of(&records);
    let (cycles, width) = (near / rate, within / rate);
    let folded = alias(cycles);
    let found = power.maximum(folded - width..folded + width, power.largest);
    let Some(found) = found else {
        return Err(SineFitError::NoTone { near: Some(near), lines: lines(channels, rate) });
    };
    let zone = cycles.round();
    let sign = if cycles >= zone { 1.0 } else { -1.0 };
    Ok(rate * (zone + sign * found))
}

/// The error of a fit that began at a peak. Where it did not converge, and the peak is none of the largest
/// lines, there is no tone, but those lines.
pub(crate) fn with_lines(error: SineFitError, channels: &[Channel<'_>], rate: Hertz) -> SineFitError {
    let SineFitError::NoConvergence { frequency, .. } = error else { return error };
    let lines = lines(channels, rate);
    let length = channels.iter().map(|channel| channel.samples.len()).min().unwrap_or(0);
    let folded = |frequency: Hertz| alias(frequency / rate).abs() * length as f64;
    let is_line = lines.iter().any(|line| (folded(*line) - folded(frequency)).abs() < 1.0);
    if lines.is_empty() || is_line { error } else { SineFitError::NoTone { near: Some(frequency), lines } }
}

/// The lines that a message names.
fn lines(channels: &[Channel<'_>], rate: Hertz) -> Vec<Hertz> {
    find_tones(channels, rate, NAMED_LINES, NAMED_RANGE).unwrap_or_default()
}

/// The sum of the Hann-windowed power spectra of all records.
struct Power {
    bins: Vec<f64>,
    /// Length of the transforms: that of the shortest record.
    length: usize,
    /// Largest deviation of a sample from the mean of its record, with the mean's own size.
    largest: f64,
}

impl Power {
    fn of(records: &[Vec<f64>]) -> Self {
        let length = records.iter().map(Vec::len).min().unwrap_or(0);
        let mut bins = vec![0.0; length / 2 + 1];
        let mut largest: f64 = 0.0;
        let step = TAU / length as f64;
        let hann = |(n, x): (usize, f64)| x * 0.5 * (1.0 - (step * n as f64).cos());
        for record in records {
            let finite = record[..length].iter().filter(|x| x.is_finite());
            largest = finite.fold(largest, |most, x| most.max(x.abs()));
            let deviations = Channel::new(&record[..length]).deviations();
            let windowed: Vec<f64> = deviations.into_iter().enumerate().map(hann).collect();
            let spectrum = fourier::real_spectrum(&windowed);
            bins.iter_mut().zip(&spectrum).for_each(|(bin, x)| *bin += x.norm_sqr());
        }
        Self { bins, length, largest }
    }

    /// The same, if it is a maximum: the skirt of a line outside the range is none. Its bin may be the next
    /// one outside.
    fn maximum(&self, range: Range<f64>, largest: f64) -> Option<f64> {
        let at = self.largest_bin(range)?;
        let inner = 1..self.bins.len().saturating_sub(1);
        let power = |m: usize| if inner.contains(&m) { self.bins[m] } else { 0.0 };
        let at = [at - 1, at + 1].into_iter().fold(at, |at, m| if power(m) > power(at) { m } else { at });
        let is_maximum = power(at) >= power(at - 1) && power(at) >= power(at + 1);
        (is_maximum && self.is_significant(at, largest)).then(|| self.interpolated(at))
    }

    /// The largest bin with an alias in `range`.
    fn largest_bin(&self, range: Range<f64>) -> Option<usize> {
        let bin = |cycles: f64| (cycles * self.length as f64).max(0.0);
        // The first bins hold the rest of the constant, the last one is half the rate.
        let first = (bin(range.start).floor() as usize).max(1);
        let last = (bin(range.end).ceil() as usize).min(self.bins.len().saturating_sub(2));
        let inside = first..=last.max(first);
        inside.filter(|&m| m < self.bins.len()).max_by(|&a, &b| self.bins[a].total_cmp(&self.bins[b]))
    }

    fn is_significant(&self, at: usize, largest: f64) -> bool {
        let rounding = TRANSFORM_ROUNDING * largest * self.length as f64;
        let mut others: Vec<f64> =
            self.bins.iter().enumerate().filter(|(m, _)| m.abs_diff(at) > LOBE).map(|(_, x)| *x).collect();
        if self.bins[at] <= rounding * rounding {
            return false;
        }
        let middle = others.len() / 2;
        // A record of a few samples has no bins without the tone.
        let Some((_, median, _)) =
            (!others.is_empty()).then(|| others.select_nth_unstable_by(middle, f64::total_cmp))
        else {
            return true;
        };
        // The median of an exponential distribution is ln 2 times its mean.
        self.bins[at] > SIGNIFICANCE * (self.bins.len() as f64).ln() * (*median / LN_2)
    }

    /// With the ratio r of the larger neighbour's amplitude to the peak's, a tone is (2 r - 1) / (r + 1)
    /// bins from the peak towards that neighbour (exact for one complex exponential under a Hann window).
    fn interpolated(&self, at: usize) -> f64 {
        let left = self.bins[at - 1];
        let right = self.bins.get(at + 1).copied().unwrap_or(0.0);
        let ratio = (left.max(right) / self.bins[at]).sqrt();
        let away = ((2.0 * ratio - 1.0) / (ratio + 1.0)).clamp(0.0, 0.5);
        let shift = if right >= left { away } else { -away };
        (at as f64 + shift) / self.length as f64
    }
}
