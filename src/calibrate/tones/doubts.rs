//! Tones whose intervals would be too short.

use super::super::measured::Measured;
use super::super::remark::Remark;
use super::captured::Captures;
use crate::sine_fit::{Direction, SineFit};

/// Harmonics that are looked at.
const HARMONICS: std::ops::RangeInclusive<usize> = 2..=10;
/// Two frequencies closer than this, in cycles per record, disturb each other.
const RESOLUTION: f64 = 1.5;
/// Most phases that count as few. Of more, quantisation errors are as good as independent.
const FEW: usize = 64;
/// Constant, cosine and sine: what a fit takes out of the pattern of phases.
const FITTED: usize = 3;

/// Distance of two frequencies, cycles per sample, after aliasing.
fn distance(a: f64, b: f64) -> f64 {
    let alias = |f: f64| (f - f.round()).abs();
    (alias(a) - alias(b)).abs()
}

/// Whether a frequency (cycles per sample) is that of a harmonic of `fundamental` in a record of `frames`.
pub(super) fn is_harmonic(cycles: f64, fundamental: f64, frames: usize) -> bool {
    HARMONICS.into_iter().any(|h| distance(h as f64 * fundamental, cycles) * (frames as f64) < RESOLUTION)
}

/// Harmonics that fall onto the tone, and few distinct phases, by which its errors are widened.
pub(super) fn of_tone(
    tone: &mut Measured,
    sines: &SineFit,
    t: usize,
    captures: &Captures<'_>,
    reference: usize,
) -> Vec<Remark> {
    let frames = captures.frames();
    let falls = |h: &usize| distance(*h as f64 * tone.cycles, tone.cycles) * (frames as f64) < RESOLUTION;
    let harmonic = HARMONICS.into_iter().find(falls);
    let mut remarks: Vec<Remark> =
        harmonic.map(|order| Remark::HarmonicOnTone { tone: tone.frequency, order }).into_iter().collect();
    if let Some(phases) = few_phases(tone.cycles, frames) {
        remarks.push(Remark::FewPhases { tone: tone.frequency, phases });
        widen(tone, sines, t, captures, Pattern { phases, reference });
    }
    remarks
}

/// The number of distinct phases, if it is small: the record's phases stay near q values where q periods of
/// the samples are a whole number of periods of the tone to less than a cycle per record.
fn few_phases(cycles: f64, frames: usize) -> Option<usize> {
    (1..=FEW).find(|&q| {
        let turns = q as f64 * cycles;
        (turns - turns.round()).abs() * (frames as f64) < 1.0
    })
}

/// Phases that repeat, and the channel that all others are compared with.
struct Pattern {
    phases: usize,
    reference: usize,
}

/// What the residual repeats with the phase also hides in the tone itself: a pattern of q values of variance
/// u^2 adds 2 u^2 / q to the variance of each part of the amplitude. An exponential has a quarter of that of
/// the real and of the imaginary part.
fn widen(tone: &mut Measured, sines: &SineFit, t: usize, captures: &Captures<'_>, pattern: Pattern) {
    let Pattern { phases, reference } = pattern;
    if phases <= FITTED {
        return;
    }
    let relative = |i: usize| {
        let (record, parts) = (captures.record(i), captures.parts(i));
        let share = 1.0 / parts.len().pow(2) as f64;
        let variance = |(part, samples): (usize, &[f64])| {
            let residual = sines.residual(part, samples);
            share * pattern_variance(&residual, &record.keep, phases, sines.channels[part].noise)
        };
        let variance: f64 = parts.zip(record.parts()).map(variance).sum();
        let amplitude = captures.tone(sines, i, t, Direction::Forward).amplitude.value;
        2.0 * variance / phases as f64 / amplitude.powi(2)
    };
    let added: Vec<f64> = (0..tone.sigmas.len()).map(relative).collect();
    for (sigmas, own) in tone.sigmas.iter_mut().zip(&added) {
        let more = (own + added[reference]).sqrt();
        *sigmas = (sigmas.0.hypot(more), sigmas.1.hypot(more));
    }
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
