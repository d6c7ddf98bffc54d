//! The amplitudes of lines, and what is left without them.

use super::expected::{Expected, Pattern, unexpected};
use super::record::RecordParts;
use super::{Cause, MeasureError};
use crate::sine_fit::{Sense, SineFit, alias, find_tones, fit, fit_known};
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
/// Times that tones and lines, and expected and unexpected lines, are fitted in turn. Each time reduces the
/// error that spurs cause in the frequency of a tone by their correlation with it, which is below 1 / (3 d)
/// for a distance of d cycles per record.
const ALTERNATIONS: usize = 3;

/// A line and its amplitude.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FoundLine {
    pub(super) frequency: Hertz,
    /// Of the sine of the same power: sqrt 2 times that of a line at half the rate.
    pub(super) amplitude: f64,
    pub(super) causes: Vec<Cause>,
}

/// All lines beside the tones.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lines {
    pub(super) found: Vec<FoundLine>,
    /// What is left without tones, constant and lines; 0 where a sample is missing.
    pub(super) rest: RecordParts<'static>,
    /// Variance of the noise of a part.
    pub(super) noise_power: f64,
    /// Amplitude above which a line counts as a spur.
    pub(super) threshold: f64,
}

/// Fits all expected lines together with the tones, whose frequencies are known, and searches the rest for
/// more.
pub(super) fn fit_lines(
    record: &RecordParts<'_>,
    tones: &SineFit,
    expected: &Expected,
    pattern: &Pattern<'_>,
) -> Result<Lines, MeasureError> {
    let used = record.used();
    let lines = tones.frequencies.len() + expected.lines.len();
    let parameters = 1 + 2 * lines + usize::from(expected.half_rate.is_some());
    let needed = SAMPLES_PER_PARAMETER * parameters;
    if used < needed {
        return Err(MeasureError::TooShort { samples: used, lines, needed });
    }
    let mut together = Together::fit(record, tones, expected)?;
    let mut unexpected = Unexpected::search(&together.rest, tones.rate, pattern, expected);
    let finish = |together: &Together, unexpected: &Unexpected| {
        let mut found = together.found(record, pattern, expected);
        found.extend(unexpected.found.iter().cloned());
        let parameters = parameters + 3 * unexpected.found.len() / record.parts().len();
        Lines::new(found, unexpected.rest.filled(), used, parameters)
    };
    let mut lines = finish(&together, &unexpected);
    // Large unexpected lines leak into the expected ones, so these are fitted again without them.
    for _ in 1..ALTERNATIONS {
        if unexpected.largest <= lines.threshold {
            break;
        }
        together = Together::fit(&record.minus(&unexpected.waves), tones, expected)?;
        let rest = together.rest.plus(&unexpected.waves);
        unexpected = Unexpected::search(&rest, tones.rate, pattern, expected);
        lines = finish(&together, &unexpected);
    }
    Ok(lines)
}

impl Lines {
    /// Of what a fit of so many parameters to so many samples leaves.
    fn new(found: Vec<FoundLine>, rest: RecordParts<'static>, used: usize, parameters: usize) -> Self {
        let noise_power = rest.energy() / used.saturating_sub(parameters).max(1) as f64;
        let log_probability = SIGNIFICANCE + (found.len().max(1) as f64).ln();
        let values = (used * rest.parts().len()) as f64;
        let threshold = (4.0 * noise_power / values * log_probability).sqrt();
        Self { found, rest, noise_power, threshold }
    }
}

/// Tones and lines, fitted together.
struct Together {
    /// The tones, then the expected lines.
    fit: SineFit,
    /// a of the line (-1)^n a, for each part.
    half_rate: Vec<f64>,
    /// What is left.
    rest: RecordParts<'static>,
}

impl Together {
    /// The lines disturb the first fit of the tones, so these are fitted again in what is left without
    /// lines.
    fn fit(record: &RecordParts<'_>, tones: &SineFit, expected: &Expected) -> Result<Self, MeasureError> {
        let rate = tones.rate;
        let mut found: Vec<Hertz> = tones.frequencies.iter().map(|f| f.value).collect();
        let lines = found.len()..found.len() + expected.lines.len();
        let mut record = record.map(|_, part| part.to_vec());
        let mut half_rate = vec![0.0; record.parts().len()];
        let mut rounds = ALTERNATIONS;
        loop {
            let beside = expected.lines.iter().map(|line| rate * line.cycles);
            let all: Vec<Hertz> = found.iter().copied().chain(beside).collect();
            let whole = fit_known(&record.channels(), rate, &all)?;
            let mut rest = record.residual(&whole);
            if expected.half_rate.is_some() {
                let more: Vec<f64> = rest.parts().iter().map(|part| half_rate_of(part)).collect();
                half_rate.iter_mut().zip(&more).for_each(|(sum, a)| *sum += a);
                record = record.map(|i, part| without_half_rate(part, more[i]));
                rest = rest.map(|i, part| without_half_rate(part, more[i]));
            }
            rounds -= 1;
            if rounds == 0 {
                return Ok(Self { fit: whole, half_rate, rest });
            }
            let cleaned = record.map(|i, part| whole.without(i, part, lines.clone()));
            let tones = fit(&cleaned.channels(), rate, &found)?;
            found = tones.frequencies.iter().map(|f| f.value).collect();
        }
    }

    /// The expected lines, and in complex records the images of the tones.
    fn found(&self, record: &RecordParts<'_>, pattern: &Pattern<'_>, expected: &Expected) -> Vec<FoundLine> {
        let (rate, tones) = (self.fit.rate, pattern.tones.len());
        let tones_of_images = (0..tones).filter(|_| pattern.is_complex);
        let images = tones_of_images.map(|k| FoundLine {
            frequency: rate * -pattern.seen(pattern.tones[k]),
            amplitude: record.amplitude(&self.fit, k, Sense::Backward),
            causes: vec![Cause::Image { order: 1, tone: pattern.number(k) }],
        });
        let lines = expected.lines.iter().enumerate().flat_map(|(k, line)| {
            record.directions().iter().map(move |&direction| FoundLine {
                frequency: rate * (direction.sign() * line.cycles),
                amplitude: record.amplitude(&self.fit, tones + k, direction),
                causes: line.causes(direction).to_vec(),
            })
        });
        let size = self.half_rate.iter().fold(0.0, |size: f64, a| size.hypot(*a));
        let half_rate = expected.half_rate.map(|cause| FoundLine {
            frequency: rate * 0.5,
            amplitude: size * if record.is_complex() { 1.0 } else { SQRT_2 },
            causes: vec![cause],
        });
        images.chain(lines).chain(half_rate).collect()
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

/// x[n] - (-1)^n a.
fn without_half_rate(samples: &[f64], a: f64) -> Vec<f64> {
    samples.iter().enumerate().map(|(n, x)| x - sign(n) * a).collect()
}

/// The largest lines that nothing announces.
struct Unexpected {
    found: Vec<FoundLine>,
    /// The sum of those that are apart from tones and expected lines. What is left of a line beside it is
    /// that line's own.
    waves: RecordParts<'static>,
    /// The largest amplitude of these.
    largest: f64,
    /// What is left without any of them.
    rest: RecordParts<'static>,
}

impl Unexpected {
    /// Fits and subtracts the largest lines of the rest, one after the other; those of complex records with
    /// what is at minus their frequency.
    fn search(rest: &RecordParts<'static>, rate: Hertz, pattern: &Pattern<'_>, expected: &Expected) -> Self {
        let waves = rest.map(|_, part| vec![0.0; part.len()]);
        let mut all = Self { found: Vec::new(), waves, largest: 0.0, rest: rest.clone() };
        for _ in 0..MOST_UNEXPECTED {
            let channels = all.rest.channels();
            let Ok(start) = find_tones(&channels, rate, 1, RANGE) else { break };
            let Ok(line) = fit(&channels, rate, &start) else { break };
            let cycles = line.frequencies[0].value / rate;
            let sides: Vec<FoundLine> = all
                .rest
                .directions()
                .iter()
                .map(|&direction| {
                    let cycles = direction.sign() * cycles;
                    let causes = vec![unexpected(pattern, expected, cycles)];
                    FoundLine {
                        frequency: rate * cycles,
                        amplitude: all.rest.amplitude(&line, 0, direction),
                        causes,
                    }
                })
                .collect();
            let largest = sides.iter().fold(0.0, |largest: f64, side| largest.max(side.amplitude));
            let faint = |first: &FoundLine| largest < first.amplitude * (-RANGE).amplitude_ratio();
            if all.found.first().is_some_and(faint) {
                break;
            }
            all.found.extend(sides);
            let rest = all.rest.residual(&line);
            if !expected.holds(pattern, alias(cycles)) {
                all.waves = all.waves.plus(&all.rest.minus(&rest));
                all.largest = all.largest.max(largest);
            }
            all.rest = rest;
        }
        all
    }
}
