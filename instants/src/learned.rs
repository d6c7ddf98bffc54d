//! The spectrum of a signal from a first estimate of it.

use super::spectrum::Spectrum;
use hybank_core::units::{CyclesPerFastPeriod, FastPeriods};
use hybank_linalg::fourier::real_spectrum;
use std::f64::consts::TAU;
use std::ops::Range;

/// Samples of a segment.
const SEGMENT: usize = 512;
/// Bins on either side that join in the mean of a bin.
const BESIDE: usize = 2;
/// The least density over the largest one.
const FLOOR: f64 = 1e-10;

/// Welch's estimate of the spectrum of `signal` over some of its `parts`, and the power there; `None` if
/// none of these holds a segment. It is smoothed, because each segment has few degrees of freedom, and has a
/// floor 100 dB below its largest density.
///
/// The signal is an estimate: what passed `gain`, by bands, was the signal with noise of the density
/// `noise`, as power per cycle per fast period over both signs of frequency. So its spectrum is divided by
/// the square of the gain, and the noise is subtracted.
pub fn learned(
    signal: &[f64],
    parts: &[Range<usize>],
    noise: f64,
    gain: &dyn Fn(Range<CyclesPerFastPeriod>) -> f64,
    longest: FastPeriods,
) -> Option<(Spectrum, f64)> {
    let mut density = [0.0; SEGMENT / 2 + 1];
    let mut count = 0;
    let starts =
        |part: &Range<usize>| (part.start..(part.end + 1).saturating_sub(SEGMENT)).step_by(SEGMENT / 2);
    for start in parts.iter().flat_map(starts) {
        let segment = &signal[start..start + SEGMENT];
        let windowed: Vec<f64> = segment.iter().enumerate().map(|(n, x)| x * hann(n)).collect();
        density.iter_mut().zip(real_spectrum(&windowed)).for_each(|(sum, bin)| *sum += bin.norm_sqr());
        count += 1;
    }
    // The powers of both signs of a frequency are together; the squares of the window have the mean 3/8.
    let power = (2.0 * density.iter().sum::<f64>() - density[0] - density[SEGMENT / 2])
        / (count as f64 * (SEGMENT * SEGMENT) as f64 * 0.375);
    if power.is_nan() || power <= 0.0 {
        return None;
    }
    let most = density.iter().copied().fold(0.0, f64::max);
    let logarithms: Vec<f64> = density.iter().map(|density| density.max(FLOOR * most).ln()).collect();
    // The sums over all segments that white noise of this density has in each bin.
    let of_noise = noise * count as f64 * SEGMENT as f64 * 0.375;
    let edge = |k: f64| CyclesPerFastPeriod((k / SEGMENT as f64).clamp(0.0, 0.5));
    let band = |k: usize| edge(k as f64 - 0.5)..edge(k as f64 + 0.5);
    let smooth = |k: usize| {
        let beside = &logarithms[k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(logarithms.len())];
        let density = (beside.iter().sum::<f64>() / beside.len() as f64).exp();
        (density / gain(band(k)).powi(2) - of_noise).max(FLOOR * most)
    };
    let bins = (0..logarithms.len()).map(|k| (band(k), smooth(k)));
    Some((Spectrum::of_pieces(bins, longest), power))
}

fn hann(n: usize) -> f64 {
    0.5 - 0.5 * (TAU * (n as f64 + 0.5) / SEGMENT as f64).cos()
}
