//! Tones whose intervals would be too short: harmonics on the tone, and quantisation that repeats with it.

use super::phasors::{Captures, Measured};
use crate::calibrate::warning::Warning;
use crate::linalg::Complex;
use crate::sine_fit::{Direction, SineFit, alias};

/// Harmonics that are looked at.
const HARMONICS: std::ops::RangeInclusive<usize> = 2..=10;
/// Two frequencies closer than this, in cycles per record, disturb each other.
const RESOLUTION: f64 = 1.5;
/// Most phases that count as few. Of more, quantisation errors are as good as independent.
const FEW_PHASES: usize = 64;
/// Constant, cosine and sine: what a fit takes out of the pattern of phases.
const FITTED: usize = 3;

/// The order of the harmonic of `fundamental` at a frequency (both cycles per sample) in a record.
fn harmonic_at(cycles: f64, fundamental: f64, frames: usize) -> Option<usize> {
    let distance = |h: usize| (alias(h as f64 * fundamental) - alias(cycles)).abs();
    HARMONICS.into_iter().find(|&h| distance(h) * (frames as f64) < RESOLUTION)
}

/// Whether a frequency (cycles per sample) is that of a harmonic of `fundamental` in a record of `frames`.
pub(super) fn is_harmonic(cycles: f64, fundamental: f64, frames: usize) -> bool {
    harmonic_at(cycles, fundamental, frames).is_some()
}

/// Harmonics that fall onto the tone, and few distinct phases, by which its errors are widened.
pub(super) fn warnings(
    tone: &mut Measured,
    sines: &SineFit,
    t: usize,
    captures: &Captures<'_>,
    reference: usize,
) -> Vec<Warning> {
    let frames = captures.frames();
    let harmonic = harmonic_at(tone.cycles, tone.cycles, frames);
    let harmonic = harmonic.map(|order| Warning::HarmonicOnTone { tone: tone.frequency, order });
    let phases = few_phases(tone.cycles, frames);
    if let Some(phases) = phases.filter(|&phases| phases > FITTED) {
        widen(tone, reference, |i| repeating_variance(sines, t, captures, i, phases));
    }
    let few = phases.map(|phases| Warning::FewPhases { tone: tone.frequency, phases });
    harmonic.into_iter().chain(few).collect()
}

/// The number of distinct phases, if it is small: the record's phases stay near q values where q periods of
/// the samples are a whole number of periods of the tone to less than a cycle per record.
fn few_phases(cycles: f64, frames: usize) -> Option<usize> {
    (1..=FEW_PHASES).find(|&q| {
        let whole = q as f64 * cycles;
        (whole - whole.round()).abs() * (frames as f64) < 1.0
    })
}

/// Adds a relative variance of each channel's phasor, with that of the reference, to the errors.
fn widen(tone: &mut Measured, reference: usize, variance: impl Fn(usize) -> f64) {
    let added: Vec<f64> = (0..tone.sigmas.len()).map(variance).collect();
    for (sigmas, own) in tone.sigmas.iter_mut().zip(&added) {
        let more = (own + added[reference]).sqrt();
        *sigmas = Complex::new(sigmas.re.hypot(more), sigmas.im.hypot(more));
    }
}

/// What the residual repeats with the phase also hides in the tone itself: a pattern of q values of variance
/// u^2 adds 2 u^2 / q to the variance of each part of the amplitude, here relative to it. An exponential has
/// a quarter of that of the real and of the imaginary part.
fn repeating_variance(sines: &SineFit, t: usize, captures: &Captures<'_>, i: usize, phases: usize) -> f64 {
    let (record, parts) = (&captures.records[i], captures.parts(i));
    let share = 1.0 / parts.len().pow(2) as f64;
    let variance = |(part, samples): (usize, &[f64])| {
        let residual = sines.residual(part, samples);
        share * pattern_variance(&residual, &record.keep, phases, sines.channels[part].noise)
    };
    let variance: f64 = parts.zip(record.parts()).map(variance).sum();
    let amplitude = captures.tone(sines, i, t, Direction::Forward).amplitude.value;
    2.0 * variance / phases as f64 / amplitude.powi(2)
}

/// The variance of what repeats with period `phases`, beyond that of noise of standard deviation `noise`.
fn pattern_variance(residual: &[f64], keep: &[bool], phases: usize, noise: f64) -> f64 {
    let (mut sums, mut counts) = (vec![0.0; phases], vec![0.0; phases]);
    for (n, (r, _)) in residual.iter().zip(keep).enumerate().filter(|(_, (_, keep))| **keep) {
        sums[n % phases] += r;
        counts[n % phases] += 1.0;
    }
    let means = sums.iter().zip(&counts).map(|(sum, count): (&f64, &f64)| sum / count.max(1.0));
    let squares: f64 = means.map(|mean| mean * mean).sum();
    let used: f64 = counts.iter().sum();
    (squares / (phases - FITTED) as f64 - noise * noise * phases as f64 / used.max(1.0)).max(0.0)
}
