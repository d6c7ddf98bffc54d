//! Real and complex records, their ends, and what the parts of complex ones lack of quadrature.

use crate::sine_fit::{Channel, Component, Estimate, Ratio, Sense, SineFit};
use crate::units::{Decibels, Radians};
use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, SQRT_2};

/// Fewest samples at either end that are looked at.
const FEWEST: usize = 8;
/// The power of a piece relative to the middle from which on it belongs to an end.
const RAISED_POWER: f64 = 4.0;

/// The samples of a record. Powers are means over its parts, so that those of a tone of the amplitude A are
/// A^2 / 2 for both kinds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RecordParts<'a> {
    /// The real samples, or the real and the imaginary parts, which are of one length.
    parts: Vec<Cow<'a, [f64]>>,
}

impl<'a> RecordParts<'a> {
    pub(super) fn real(samples: &'a [f64]) -> Self {
        Self { parts: vec![Cow::Borrowed(samples)] }
    }

    /// A sample is missing if one of its parts is.
    pub(super) fn complex(real: &'a [f64], imaginary: &'a [f64]) -> Self {
        let is_whole = real.iter().zip(imaginary).all(|(x, y)| x.is_finite() == y.is_finite());
        if is_whole {
            return Self { parts: vec![Cow::Borrowed(real), Cow::Borrowed(imaginary)] };
        }
        let masked = |own: &[f64], other: &[f64]| {
            let pairs = own.iter().zip(other);
            Cow::Owned(pairs.map(|(x, y)| if y.is_finite() { *x } else { f64::NAN }).collect())
        };
        Self { parts: vec![masked(real, imaginary), masked(imaginary, real)] }
    }

    pub(super) fn parts(&self) -> &[Cow<'a, [f64]>] {
        &self.parts
    }

    pub(super) fn is_complex(&self) -> bool {
        self.parts.len() > 1
    }

    pub(super) fn len(&self) -> usize {
        self.parts[0].len()
    }

    pub(super) fn channels(&self) -> Vec<Channel<'_>> {
        self.parts.iter().map(|part| Channel::new(part)).collect()
    }

    /// Samples that are not missing.
    pub(super) fn used(&self) -> usize {
        self.parts[0].iter().filter(|x| x.is_finite()).count()
    }

    /// The same of each part, which is given with its number.
    pub(super) fn map(&self, change: impl Fn(usize, &[f64]) -> Vec<f64>) -> RecordParts<'static> {
        let parts = self.parts.iter().enumerate();
        RecordParts { parts: parts.map(|(i, part)| Cow::Owned(change(i, part))).collect() }
    }

    /// Without so many samples at either end.
    pub(super) fn without_ends(&self, samples: usize) -> RecordParts<'static> {
        self.map(|_, part| part[samples..part.len() - samples].to_vec())
    }

    /// With zeros in place of missing samples.
    pub(super) fn filled(&self) -> RecordParts<'static> {
        self.map(|_, part| part.iter().map(|x| if x.is_finite() { *x } else { 0.0 }).collect())
    }

    pub(super) fn plus(&self, other: &RecordParts<'_>) -> RecordParts<'static> {
        self.map(|i, part| part.iter().zip(other.parts[i].iter()).map(|(x, y)| x + y).collect())
    }

    pub(super) fn minus(&self, other: &RecordParts<'_>) -> RecordParts<'static> {
        self.map(|i, part| part.iter().zip(other.parts[i].iter()).map(|(x, y)| x - y).collect())
    }

    /// What a fit leaves.
    pub(super) fn residual(&self, fit: &SineFit) -> RecordParts<'static> {
        self.map(|i, part| fit.residual(i, part))
    }

    /// Mean over the parts of the sum of all squares.
    pub(super) fn energy(&self) -> f64 {
        let squares = self.parts.iter().flat_map(|part| part.iter()).map(|x| x * x);
        squares.sum::<f64>() / self.parts.len() as f64
    }

    /// The root of the mean square of the parts, sample by sample.
    pub(super) fn size(&self) -> Cow<'_, [f64]> {
        match self.parts.as_slice() {
            [real, imaginary] => {
                Cow::Owned(real.iter().zip(imaginary.iter()).map(|(x, y)| x.hypot(*y) / SQRT_2).collect())
            }
            parts => Cow::Borrowed(&parts[0]),
        }
    }

    /// The exponentials that a frequency may have.
    pub(super) fn directions(&self) -> &'static [Sense] {
        if self.is_complex() { &[Sense::Forward, Sense::Backward] } else { &[Sense::Forward] }
    }

    /// The sine in a fit of this record, or the exponential.
    pub(super) fn wave(&self, direction: Sense) -> Component {
        if self.is_complex() { Component::Complex([0, 1], direction) } else { Component::Real(0) }
    }

    /// The amplitude at plus or minus the frequency of a tone.
    pub(super) fn amplitude(&self, fit: &SineFit, tone: usize, direction: Sense) -> f64 {
        match self.wave(direction) {
            Component::Real(part) => fit.channels[part].tones[tone].amplitude.value,
            wave => fit.phasor(wave, tone).amplitude.value,
        }
    }
}

/// What the parts of a complex record lack of equal gains, of quadrature and of offsets of 0 (I/Q
/// imbalance).
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Quadrature {
    /// The constant of the imaginary parts.
    pub offset: Estimate<f64>,
    /// One per tone, at its frequency.
    pub imbalances: Vec<Imbalance>,
}

/// The imbalance of the parts at a tone. With the gain g and the phase error p the imaginary part of
/// e^{j w t} is g sin(w t + p), and the image of the tone has the relative size
///
/// ```text
/// abs(b / a) = sqrt( (1 - 2 g cos p + g^2) / (1 + 2 g cos p + g^2) )
/// ```
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Imbalance {
    /// g, the gain of the imaginary part relative to that of the real part.
    pub gain: Estimate<f64>,
    /// p, the error of the quadrature.
    #[serde(rename = "phase_radians")]
    pub phase: Estimate<Radians>,
    /// Tone over image.
    #[serde(rename = "image_rejection_db")]
    pub image_rejection: Decibels,
}

impl Quadrature {
    /// Of the fit of both parts.
    pub(super) fn of(fit: &SineFit) -> Self {
        let imbalances = (0..fit.tones()).map(|tone| Imbalance::of(fit, tone)).collect();
        Self { offset: fit.channels[1].constant, imbalances }
    }
}

impl Imbalance {
    fn of(fit: &SineFit, tone: usize) -> Self {
        let Ratio { gain, phase } = fit.ratio(Component::Real(1), Component::Real(0), tone);
        let [tone, image] = [Sense::Forward, Sense::Backward]
            .map(|direction| fit.phasor(Component::Complex([0, 1], direction), tone).amplitude.value);
        // The difference of phases beyond minus a quarter of a cycle, in -pi ..= pi.
        let (sine, cosine) = (phase.value.0 + FRAC_PI_2).sin_cos();
        Self {
            gain,
            phase: Estimate { value: Radians(sine.atan2(cosine)), sigma: phase.sigma },
            image_rejection: Decibels::of_amplitude(tone / image),
        }
    }
}

/// Samples at the ends of a record that hold most of what no line explains: a filter that had no input
/// before the first sample, for example.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct UnsettledEnds {
    /// Samples at either end.
    pub samples: usize,
    /// Power of the rest of the whole record over that without these samples. The gain of leaving them out
    /// is larger, because they pull at the fit of the tones too.
    #[serde(rename = "raise_db")]
    pub raise: Decibels,
}

impl UnsettledEnds {
    /// The ends of a rest whose power they at least double. Pieces of 8, 16, 32 .. samples are compared with
    /// the middle half. `None` too if more than an eighth at either end is raised: such a record changes all
    /// along.
    pub(super) fn of(rest: &[f64]) -> Option<Self> {
        let n = rest.len();
        let (whole, middle) = (mean_square(rest), mean_square(&rest[n / 4..n - n / 4]));
        if whole <= 2.0 * middle {
            return None;
        }
        let is_raised = |k: usize| {
            [k..2 * k, n - 2 * k..n - k].into_iter().any(|at| mean_square(&rest[at]) > RAISED_POWER * middle)
        };
        let mut samples = FEWEST;
        while 8 * samples <= n && is_raised(samples) {
            samples *= 2;
        }
        let is_an_end = 8 * samples <= n;
        is_an_end.then(|| Self {
            samples,
            raise: Decibels::of_power(whole / mean_square(&rest[samples..n - samples])),
        })
    }
}

fn mean_square(samples: &[f64]) -> f64 {
    samples.iter().map(|x| x * x).sum::<f64>() / samples.len().max(1) as f64
}
