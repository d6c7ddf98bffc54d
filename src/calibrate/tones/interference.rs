//! Tones whose intervals would be too short: harmonics on the tone, and quantisation that repeats with it.

use super::phasors::{TonePhasors, ToneRecords};
use crate::calibrate::warning::CalibrationWarning;
use crate::linalg::Complex;
use crate::sine_fit::{Sense, SineFit, alias};

/// Harmonics that are looked at.
const HARMONICS: std::ops::RangeInclusive<usize> = 2..=10;
/// Two frequencies closer than this, in cycles per record, disturb each other.
const RESOLVED_CYCLES: f64 = 1.5;
/// Most phases of a tone that count as few: of more, errors of quantisation average as those of noise do.
const FEW_PHASES: usize = 64;
/// Periods of a pattern that tell it from noise.
const LEAST_PERIODS: usize = 8;

/// The order of the harmonic of `fundamental` at a frequency (both cycles per sample) in a record.
fn harmonic_at(cycles: f64, fundamental: f64, frames: usize) -> Option<usize> {
    let distance = |h: usize| (alias(h as f64 * fundamental) - alias(cycles)).abs();
    HARMONICS.into_iter().find(|&h| distance(h) * (frames as f64) < RESOLVED_CYCLES)
}

/// Whether a frequency (cycles per sample) is that of a harmonic of `fundamental` in a record of `frames`.
pub(super) fn is_harmonic(cycles: f64, fundamental: f64, frames: usize) -> bool {
    harmonic_at(cycles, fundamental, frames).is_some()
}

/// Harmonics that fall onto the tone, and few phases.
pub(super) fn warnings(
    tone: &TonePhasors,
    frames: usize,
) -> impl Iterator<Item = CalibrationWarning> + use<> {
    let harmonic = harmonic_at(tone.cycles, tone.cycles, frames);
    let harmonic = harmonic.map(|order| CalibrationWarning::HarmonicOnTone { tone: tone.frequency, order });
    let few = repeats_after(&[tone.cycles], frames).filter(|&phases| phases <= FEW_PHASES);
    let few = few.map(|phases| CalibrationWarning::FewPhases { tone: tone.frequency, phases });
    harmonic.into_iter().chain(few)
}

/// The number of samples after which tones of these frequencies repeat, if the record holds several such
/// periods: q samples are a whole number of periods of each tone to less than a cycle per record.
/// Quantisation then repeats as well, however large q is.
fn repeats_after(cycles: &[f64], frames: usize) -> Option<usize> {
    let is_whole = |whole: f64| (whole - whole.round()).abs() * (frames as f64) < 1.0;
    (1..=frames / LEAST_PERIODS).find(|&q| cycles.iter().all(|cycles| is_whole(q as f64 * cycles)))
}

/// What the residual repeats also hides in tones and constants. A pattern of q values of variance u^2 adds
/// u^2 / q to the variance of the constant, which is given here for each part of the records, and twice that
/// to the variance of each part of an amplitude.
pub(super) fn repeating_variances(sines: &SineFit, captures: &ToneRecords<'_>) -> Vec<f64> {
    let cycles: Vec<f64> = sines.frequencies.iter().map(|f| f.value / sines.rate).collect();
    let fitted = 1 + 2 * cycles.len();
    let phases = repeats_after(&cycles, captures.frames()).filter(|&phases| phases > fitted);
    let Some(phases) = phases else { return vec![0.0; sines.channels.len()] };
    let pattern = RepeatingPattern { phases, fitted };
    let samples = captures.records.iter().flat_map(|one| one.parts().map(move |part| (part, &one.keep)));
    let of_part = |(part, (samples, keep)): (usize, (&[f64], &Vec<bool>))| {
        let residual = sines.residual(part, samples);
        pattern.variance(&residual, keep, sines.channels[part].noise) / phases as f64
    };
    samples.enumerate().map(of_part).collect()
}

/// Widens the errors of tone `t` by what the parts of the records repeat. An exponential has a quarter of
/// the variance of the real and of the imaginary part.
pub(super) fn widen_repeating(
    tone: &mut TonePhasors,
    t: usize,
    sines: &SineFit,
    captures: &ToneRecords<'_>,
    reference: usize,
    repeating: &[f64],
) {
    widen(tone, reference, |converter| {
        let parts = captures.parts_of(converter);
        let share = 1.0 / parts.len().pow(2) as f64;
        let first = captures.records_of(converter).start;
        let amplitude = captures.tone(sines, first, t, Sense::Forward).amplitude.value;
        2.0 * share * repeating[parts].iter().sum::<f64>() / amplitude.powi(2)
    });
}

/// Adds a relative variance of each channel's phasor, with that of the reference, to the errors.
fn widen(tone: &mut TonePhasors, reference: usize, variance: impl Fn(usize) -> f64) {
    let added: Vec<f64> = (0..tone.sigmas.len()).map(variance).collect();
    tone.reference_variance += added[reference];
    for (sigmas, own) in tone.sigmas.iter_mut().zip(&added) {
        let more = (own + added[reference]).sqrt();
        *sigmas = Complex::new(sigmas.re.hypot(more), sigmas.im.hypot(more));
    }
}

/// The variance of the mean instant of each converter, fast periods squared, as far as jitter makes it: what
/// is left of a sample has the variance a + b v^2 with v the slope of the tones, and least squares give b.
/// Both parts of a complex sample have the instant in common.
pub(super) fn jitter(sines: &SineFit, captures: &ToneRecords<'_>, ratio: usize) -> Vec<f64> {
    let of_record = |i: usize| {
        let record = &captures.records[i];
        let part = |(part, samples): (usize, &[f64])| {
            let (residual, slopes) = (sines.residual(part, samples), sines.slopes(part, samples.len()));
            let all = residual.into_iter().zip(slopes).zip(&record.keep);
            all.filter(|(_, keep)| **keep).map(|(both, _)| both).collect::<Vec<_>>()
        };
        let kept: Vec<(f64, f64)> = captures.parts(i).zip(record.parts()).flat_map(part).collect();
        let count = kept.len().max(1) as f64;
        let mean =
            |of: &dyn Fn(f64, f64) -> f64| kept.iter().map(|(r, v)| of(r * r, v * v)).sum::<f64>() / count;
        let (noise, slope) = (mean(&|r, _| r), mean(&|_, v| v));
        let shared = mean(&|r, v| (r - noise) * (v - slope));
        let spread = mean(&|_, v| (v - slope).powi(2));
        let instants = count / captures.parts(i).len() as f64;
        if spread > 0.0 { (shared / spread).max(0.0) / instants } else { 0.0 }
    };
    let of_converter = |converter| {
        let records = captures.records_of(converter);
        let share = (ratio as f64 / records.len() as f64).powi(2);
        records.map(of_record).sum::<f64>() * share
    };
    (0..captures.converters()).map(of_converter).collect()
}

/// What the samples repeat: as many values as there are phases, of which a fit takes so many out.
#[derive(Debug, Clone, Copy)]
struct RepeatingPattern {
    phases: usize,
    fitted: usize,
}

impl RepeatingPattern {
    /// The variance of what repeats, beyond that of noise of standard deviation `noise`.
    fn variance(self, residual: &[f64], keep: &[bool], noise: f64) -> f64 {
        let Self { phases, fitted } = self;
        let (mut sums, mut counts) = (vec![0.0; phases], vec![0.0; phases]);
        for (n, (r, _)) in residual.iter().zip(keep).enumerate().filter(|(_, (_, keep))| **keep) {
            sums[n % phases] += r;
            counts[n % phases] += 1.0;
        }
        let means = sums.iter().zip(&counts).map(|(sum, count): (&f64, &f64)| sum / count.max(1.0));
        let squares: f64 = means.map(|mean| mean * mean).sum();
        let used: f64 = counts.iter().sum();
        (squares / (phases - fitted) as f64 - noise * noise * phases as f64 / used.max(1.0)).max(0.0)
    }
}
