//! Real and complex records: one part or two.

use super::Cause;
use super::expected::Sides;
use crate::sine_fit::{Channel, Direction, SineFit};
use std::borrow::Cow;
use std::f64::consts::SQRT_2;

/// The samples of a record. Powers are means over its parts, so that those of a tone of the amplitude A are
/// A^2 / 2 for both kinds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Record<'a> {
    /// The real samples, or the real and the imaginary parts, which are of one length.
    parts: Vec<Cow<'a, [f64]>>,
}

impl<'a> Record<'a> {
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
    pub(super) fn map(&self, change: impl Fn(usize, &[f64]) -> Vec<f64>) -> Record<'static> {
        let parts = self.parts.iter().enumerate();
        Record { parts: parts.map(|(i, part)| Cow::Owned(change(i, part))).collect() }
    }

    /// With zeros in place of missing samples.
    pub(super) fn filled(&self) -> Record<'static> {
        self.map(|_, part| part.iter().map(|x| if x.is_finite() { *x } else { 0.0 }).collect())
    }

    pub(super) fn plus(&self, other: &Record<'_>) -> Record<'static> {
        self.map(|i, part| part.iter().zip(other.parts[i].iter()).map(|(x, y)| x + y).collect())
    }

    pub(super) fn minus(&self, other: &Record<'_>) -> Record<'static> {
        self.map(|i, part| part.iter().zip(other.parts[i].iter()).map(|(x, y)| x - y).collect())
    }

    /// What a fit leaves.
    pub(super) fn residual(&self, fit: &SineFit) -> Record<'static> {
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

    /// The lines at a frequency of a fit: the sine, or the exponentials at plus and minus the frequency.
    pub(super) fn lines_of(
        &self,
        fit: &SineFit,
        tone: usize,
        causes: &Sides,
    ) -> Vec<(Direction, f64, Vec<Cause>)> {
        if !self.is_complex() {
            let amplitude = fit.channels[0].tones[tone].amplitude.value;
            return vec![(Direction::Forward, amplitude, causes.forward.clone())];
        }
        let line = |direction, causes: &Vec<Cause>| {
            (direction, fit.exponential([0, 1], tone, direction).amplitude.value, causes.clone())
        };
        vec![line(Direction::Forward, &causes.forward), line(Direction::Backward, &causes.backward)]
    }
}
