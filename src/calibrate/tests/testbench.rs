//! Virtual captures from closed forms, for the tests of all three methods.

use super::{Calibration, Record};
use crate::analog::StrictlyProper;
use crate::random::Random;
use crate::spec::Spec;
use crate::units::{Hertz, RadiansPerFastPeriod};
use std::f64::consts::TAU;

/// Four interleaved converters with M = 4 at 1 MHz, after a first-order low-pass of 2 MHz.
pub(super) fn interleaved() -> Spec {
    let text = "fast_rate = 1e6\nratio = 4\nlatency = 8\ntarget = { filter = { family = \"rc\", cutoff = 2e6 } }\n\
                channel = [{ delay_samples = 0 }, { delay_samples = 1 }, { delay_samples = 2 }, { delay_samples = 3 }]";
    Spec::from_toml(text, "spec.toml").unwrap()
}

/// `spec` with other delays (fast periods are added), gains (factors), offsets and cut-offs (factors).
pub(super) fn with_errors(spec: &Spec, errors: &[[f64; 4]]) -> Spec {
    let mut other = spec.clone();
    for (channel, [delay, gain, offset, cutoff]) in other.channels.iter_mut().zip(errors) {
        channel.delay += spec.fast_period * *delay;
        channel.gain *= gain;
        channel.offset += offset;
        channel.filter = channel.filter.with_cutoff_scaled(*cutoff);
    }
    other
}

/// Uniform errors up to the given sizes: delay in fast periods, gain and cut-off as shares, offset.
pub(super) fn random_errors(dice: &mut Random, channels: usize, sizes: [f64; 4]) -> Vec<[f64; 4]> {
    let one = |dice: &mut Random| {
        let [delay, gain, offset, cutoff] = sizes.map(|size| size * dice.sample());
        [delay, 1.0 + gain, offset, 1.0 + cutoff]
    };
    (0..channels).map(|_| one(dice)).collect()
}

/// What the true converters deliver of tones of amplitude 1 and random phase, with white Gaussian noise.
pub(super) fn tones(
    truth: &Spec,
    frequencies: &[Hertz],
    frames: usize,
    noise: f64,
    dice: &mut Random,
) -> Vec<Record> {
    let [real] = parts(truth, frequencies, [0.0], frames, noise, dice);
    real.into_iter().map(Record::new).collect()
}

/// The same of tones e^{j w t} of either sign, with noise in both parts. Both parts have the offset.
pub(super) fn complex_tones(
    truth: &Spec,
    frequencies: &[Hertz],
    frames: usize,
    noise: f64,
    dice: &mut Random,
) -> Vec<Record> {
    let [real, imaginary] = parts(truth, frequencies, [0.0, 0.25 * TAU], frames, noise, dice);
    let both = real.into_iter().zip(imaginary);
    both.map(|(real, imaginary)| Record::complex(Record::new(real), Record::new(imaginary))).collect()
}

/// Cosines of random phases, in each part with another lag of the phase, and noise.
fn parts<const P: usize>(
    truth: &Spec,
    frequencies: &[Hertz],
    lags: [f64; P],
    frames: usize,
    noise: f64,
    dice: &mut Random,
) -> [Vec<Vec<f64>>; P] {
    let phases: Vec<f64> = frequencies.iter().map(|_| TAU * dice.part()).collect();
    let mut parts = lags.map(|lag| {
        let phases: Vec<f64> = phases.iter().map(|phase| phase - lag).collect();
        waves(truth, frequencies, &phases, frames)
    });
    let samples = parts.iter_mut().flatten().flatten();
    samples.for_each(|sample| *sample += noise * gaussian(dice));
    parts
}

/// Cosines of these phases as the true converters deliver them.
fn waves(truth: &Spec, frequencies: &[Hertz], phases: &[f64], frames: usize) -> Vec<Vec<f64>> {
    let h = truth.fast_period;
    let channel = |channel: &crate::spec::ChannelSpec| {
        let filter = StrictlyProper::new(&channel.filter, h).unwrap();
        let delay = channel.delay / h;
        let mut samples = vec![channel.offset; frames];
        for (frequency, phase) in frequencies.iter().zip(phases) {
            let cycles = frequency.per_fast_period(h).0;
            let response = filter.response(RadiansPerFastPeriod(TAU * cycles));
            let step = cycles * truth.ratio as f64;
            let (gain, phase) =
                (channel.gain * response.norm(), phase + response.arg() - TAU * cycles * delay);
            for (k, sample) in samples.iter_mut().enumerate() {
                *sample += gain * (TAU * (step * k as f64).fract() + phase).cos();
            }
        }
        samples
    };
    truth.channels.iter().map(channel).collect()
}

/// As [`Random::gaussian`].
pub(crate) fn gaussian(dice: &mut Random) -> f64 {
    dice.gaussian()
}

/// Errors of the fitted values of the channels other than the reference over their standard deviations, and
/// the errors of their delays (fast periods).
pub(super) struct Errors {
    pub(super) scaled: Vec<f64>,
    pub(super) delays: Vec<f64>,
}

pub(super) fn errors(truth: &Spec, found: &Calibration) -> Errors {
    let reference = &truth.channels[found.reference];
    let (mut scaled, mut delays) = (Vec::new(), Vec::new());
    for (i, (channel, estimate)) in truth.channels.iter().zip(&found.channels).enumerate() {
        if let Some(offset) = estimate.offset.filter(|offset| offset.sigma > 0.0) {
            scaled.push((offset.value - channel.offset) / offset.sigma);
        }
        if i == found.reference {
            continue;
        }
        if let Some(delay) = estimate.delay {
            let nominal_reference = found.reference as f64;
            let expected = (channel.delay - reference.delay) / truth.fast_period + nominal_reference;
            delays.push(delay.value.0 - expected);
            scaled.push((delay.value.0 - expected) / delay.sigma.0);
        }
        if let Some(gain) = estimate.gain {
            scaled.push((gain.value - channel.gain / reference.gain) / gain.sigma);
        }
    }
    Errors { scaled, delays }
}

/// Number of seeded trials: `few`, or HYBANK_TRIALS.
pub(super) fn trials(few: u64) -> usize {
    trials::trials(few).count()
}

/// Checks a campaign of few draws: 95 % intervals hold the truth in 93 to 97 % of the cases, or differ from
/// that by less than three standard deviations of their number.
pub(super) fn assert_holds(scaled: &[f64], draws: usize, what: &str) {
    let count = scaled.len() as f64;
    let inside = scaled.iter().filter(|x| x.abs() < 1.96).count() as f64 / count;
    println!("{what}: {:.1} % of {count} intervals, {draws} draws", 100.0 * inside);
    let chance = 3.0 * (0.95 * 0.05 / count).sqrt();
    assert!((inside - 0.95).abs() < chance.max(0.02), "{what}: {:.1} % of {count}", 100.0 * inside);
}

/// Checks that 95 % intervals hold the truth in 93 to 97 % of the cases; wider for fewer trials.
pub(super) fn assert_covers(scaled: &[f64], trials: usize) {
    let inside = scaled.iter().filter(|x| x.abs() < 1.96).count() as f64 / scaled.len() as f64;
    println!("{:.2} % of {} intervals, {trials} trials", 100.0 * inside, scaled.len());
    let tolerance = 0.02 + if trials < 2000 { 0.01 } else { 0.0 };
    assert!((inside - 0.95).abs() < tolerance, "{:.2} % of {} intervals", 100.0 * inside, scaled.len());
}
