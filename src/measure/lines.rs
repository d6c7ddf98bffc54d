//! The amplitudes of lines, and what is left without them.

use super::expected::{Expected, Pattern, unexpected};
use super::{Cause, MeasureError};
use crate::sine_fit::{Channel, SineFit, find_tones, fit, fit_known};
use crate::units::{Decibels, Hertz};
use std::f64::consts::SQRT_2;

/// Unexpected lines that are looked for.
const MOST_UNEXPECTED: usize = 8;
/// Unexpected lines farther below the first one are not looked for.
const RANGE: Decibels = Decibels(60.0);
/// Samples per parameter that a fit of all lines needs.
const SAMPLES_PER_PARAMETER: usize = 4;
/// An amplitude A of a line without a spur exceeds a with the probability exp(-a^2 N / (4 s^2)), s^2 the
/// variance of the noise. This is -ln of the probability that one of all lines counts as a spur.
const SIGNIFICANCE: f64 = 7.0;
/// Times that tones and lines are fitted in turn. Each time reduces the error that spurs cause in the
/// frequency of a tone by their correlation with it, which is below 1 / (3 d) for a distance of d cycles per
/// record.
const ALTERNATIONS: usize = 3;

/// A line and its amplitude.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    pub(super) frequency: Hertz,
    /// Of the sine of the same power: sqrt 2 times that of a line at half the rate.
    pub(super) amplitude: f64,
    pub(super) causes: Vec<Cause>,
}

/// All lines beside the tones.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lines {
    pub(super) found: Vec<Found>,
    /// What is left without tones, constant and lines; 0 where a sample is missing.
    pub(super) rest: Vec<f64>,
    /// Variance of the noise.
    pub(super) noise_power: f64,
    /// Amplitude above which a line counts as a spur.
    pub(super) threshold: f64,
}

/// Fits all expected lines together with the tones, whose frequencies are known, and searches the rest for
/// more.
pub(super) fn fit_lines(
    samples: &[f64],
    tones: &SineFit,
    expected: &Expected,
    pattern: &Pattern<'_>,
) -> Result<Lines, MeasureError> {
    let (rate, channel) = (tones.rate, Channel::new(samples));
    let used = channel.used();
    let lines = tones.frequencies.len() + expected.lines.len();
    let parameters = 1 + 2 * lines + usize::from(expected.half_rate.is_some());
    let needed = SAMPLES_PER_PARAMETER * parameters;
    if used < needed {
        return Err(MeasureError::TooShort { samples: used, lines, needed });
    }
    let Together { fit, half_rate, mut rest } = Together::fit(samples, tones, expected)?;
    let amplitudes = fit.channels[0].tones[tones.frequencies.len()..].iter();
    let mut found: Vec<Found> = amplitudes
        .zip(&expected.lines)
        .map(|(tone, line)| Found {
            frequency: rate * line.cycles,
            amplitude: tone.amplitude.value,
            causes: line.causes.clone(),
        })
        .collect();
    found.extend(expected.half_rate.map(|cause| Found {
        frequency: rate * 0.5,
        amplitude: SQRT_2 * half_rate.abs(),
        causes: vec![cause],
    }));
    let more = take_unexpected(&mut rest, rate, pattern, expected);
    let parameters = parameters + 3 * more.len();
    found.extend(more);
    rest.iter_mut().filter(|x| !x.is_finite()).for_each(|x| *x = 0.0);
    let noise_power = rest.iter().map(|x| x * x).sum::<f64>() / used.saturating_sub(parameters).max(1) as f64;
    let log_probability = SIGNIFICANCE + (found.len().max(1) as f64).ln();
    let threshold = (4.0 * noise_power / used as f64 * log_probability).sqrt();
    Ok(Lines { found, rest, noise_power, threshold })
}

/// Tones and lines, fitted together.
struct Together {
    /// The tones, then the expected lines.
    fit: SineFit,
    /// a of the line (-1)^n a.
    half_rate: f64,
    /// What is left.
    rest: Vec<f64>,
}

impl Together {
    /// The lines disturb the first fit of the tones, so these are fitted again in what is left without
    /// lines.
    fn fit(samples: &[f64], tones: &SineFit, expected: &Expected) -> Result<Self, MeasureError> {
        let rate = tones.rate;
        let mut found: Vec<Hertz> = tones.frequencies.iter().map(|f| f.value).collect();
        let lines = found.len()..found.len() + expected.lines.len();
        let mut samples = samples.to_vec();
        let mut half_rate = 0.0;
        let mut rounds = ALTERNATIONS;
        loop {
            let places = expected.lines.iter().map(|line| rate * line.cycles);
            let all: Vec<Hertz> = found.iter().copied().chain(places).collect();
            let whole = fit_known(&[Channel::new(&samples)], rate, &all)?;
            let mut rest = whole.residual(0, &samples);
            if expected.half_rate.is_some() {
                let a = half_rate_of(&rest);
                half_rate += a;
                take_half_rate(&mut samples, a);
                take_half_rate(&mut rest, a);
            }
            rounds -= 1;
            if rounds == 0 {
                return Ok(Self { fit: whole, half_rate, rest });
            }
            let cleaned = whole.without(0, &samples, lines.clone());
            let tones = fit(&[Channel::new(&cleaned)], rate, &found)?;
            found = tones.frequencies.iter().map(|f| f.value).collect();
        }
    }
}

fn sign(n: usize) -> f64 {
    if n.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// The mean of (-1)^n x[n].
fn half_rate_of(samples: &[f64]) -> f64 {
    let finite = || samples.iter().enumerate().filter(|(_, x)| x.is_finite());
    finite().map(|(n, x)| sign(n) * x).sum::<f64>() / finite().count().max(1) as f64
}

/// Subtracts (-1)^n a.
fn take_half_rate(samples: &mut [f64], a: f64) {
    samples.iter_mut().enumerate().for_each(|(n, x)| *x -= sign(n) * a);
}

/// Fits and subtracts the largest lines of the rest, one after the other.
fn take_unexpected(
    rest: &mut Vec<f64>,
    rate: Hertz,
    pattern: &Pattern<'_>,
    expected: &Expected,
) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    while found.len() < MOST_UNEXPECTED {
        let channels = [Channel::new(rest)];
        let Ok(start) = find_tones(&channels, rate, 1, RANGE) else { break };
        let Ok(line) = fit(&channels, rate, &start) else { break };
        let (frequency, tone) = (line.frequencies[0].value, line.channels[0].tones[0]);
        let is_faint = |first: &Found| tone.amplitude.value < first.amplitude * (-RANGE).amplitude_ratio();
        if found.first().is_some_and(is_faint) {
            break;
        }
        let causes = vec![unexpected(pattern, expected, frequency / rate)];
        found.push(Found { frequency, amplitude: tone.amplitude.value, causes });
        *rest = line.residual(0, rest);
    }
    found
}
