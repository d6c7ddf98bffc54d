//! The offsets and the static nonlinearities of the converters, subtracted from the samples on their way to
//! the kernels.

use super::FrameSource;
use crate::{BuildError, Isa, Sample};

/// Samples after which the pattern of offsets repeats, at least: long enough for whole vectors.
const PATTERN: usize = 256;

/// What the samples of N channels contain beside the signal, frame after frame, in both number types.
#[derive(Debug)]
pub(crate) struct Corrections {
    single: Patterns<f32>,
    double: Patterns<f64>,
}

/// Patterns of whole frames.
#[derive(Debug)]
struct Patterns<T> {
    offsets: Vec<T>,
    /// a_k of the channels, from T_2 on; none if all are zero.
    orders: Vec<Vec<T>>,
}

impl Corrections {
    /// `None` if nothing is to be subtracted.
    ///
    /// # Errors
    /// [`BuildError::OffsetCount`] unless there is an offset for each of N = `channels`, and a nonlinearity
    /// unless there is none at all; [`BuildError::NotFinite`].
    pub(crate) fn new(
        offsets: &[f64],
        nonlinearity: &[Vec<f64>],
        channels: usize,
    ) -> Result<Option<Self>, BuildError> {
        if offsets.len() != channels {
            return Err(BuildError::OffsetCount { offsets: offsets.len(), channels });
        }
        if !nonlinearity.is_empty() && nonlinearity.len() != channels {
            return Err(BuildError::OffsetCount { offsets: nonlinearity.len(), channels });
        }
        check_finite("the offsets of the channels", offsets)?;
        nonlinearity.iter().try_for_each(|list| check_finite("the nonlinearity of a channel", list))?;
        let count = nonlinearity.iter().map(Vec::len).max().unwrap_or(0);
        let of_order = |k: usize| nonlinearity.iter().map(move |list| list.get(k).copied().unwrap_or(0.0));
        let orders: Vec<Vec<f64>> = (0..count).map(|k| of_order(k).collect()).collect();
        if offsets.iter().chain(orders.iter().flatten()).all(|&x| x == 0.0) {
            return Ok(None);
        }
        let repeated = |values: &[f64]| values.repeat(PATTERN.div_ceil(channels));
        let double =
            Patterns { offsets: repeated(offsets), orders: orders.iter().map(|a| repeated(a)).collect() };
        Ok(Some(Self { single: double.rounded(), double }))
    }
}

fn check_finite(location: &str, values: &[f64]) -> Result<(), BuildError> {
    match values.iter().position(|&value| !f32::from_f64(value).is_finite()) {
        Some(index) => {
            Err(BuildError::NotFinite { location: location.to_owned(), index, value: values[index] })
        }
        None => Ok(()),
    }
}

impl Patterns<f64> {
    fn rounded(&self) -> Patterns<f32> {
        let rounded = |values: &Vec<f64>| values.iter().map(|&x| f32::from_f64(x)).collect();
        Patterns { offsets: rounded(&self.offsets), orders: self.orders.iter().map(rounded).collect() }
    }
}

impl<T: Sample> Patterns<T> {
    /// Subtracts the patterns from whole frames: first the nonlinearity at the sample as it is.
    fn subtract(&self, samples: &mut [T]) {
        for part in samples.chunks_mut(self.offsets.len()) {
            if !self.orders.is_empty() {
                let curve = |n: usize, x: T| curve(self.orders.iter().map(|a| a[n]), x);
                part.iter_mut().enumerate().for_each(|(n, sample)| *sample = *sample - curve(n, *sample));
            }
            part.iter_mut().zip(&self.offsets).for_each(|(sample, &offset)| *sample = *sample - offset);
        }
    }
}

/// What a converter with the static nonlinearity a_2, a_3, .. adds to a sample: the sum of a_k T_k(x).
pub fn nonlinearity(coefficients: &[f64], x: f64) -> f64 {
    curve(coefficients.iter().copied(), x)
}

/// The sum of a_k T_k(x) from k = 2 on by Clenshaw's recurrence, at the ends of -1 .. 1 for what is beyond.
fn curve<T: Sample>(coefficients: impl DoubleEndedIterator<Item = T>, x: T) -> T {
    let one = T::from_f64(1.0);
    let x = if x > one { one } else { x };
    let x = if x < T::from_f64(-1.0) { T::from_f64(-1.0) } else { x };
    let (zero, twice) = (T::from_f64(0.0), x + x);
    let next = |(b1, b2): (T, T), a: T| (a + twice * b1 - b2, b1);
    let sums = coefficients.rev().fold((zero, zero), next);
    // a_1 and a_0 are zero.
    let (b1, b2) = next(sums, zero);
    x * b1 - b2
}

/// The frames of an input without offsets and nonlinearities. What is not finite stays so.
pub(crate) struct Corrected<'a> {
    pub(crate) input: &'a dyn FrameSource,
    pub(crate) corrections: &'a Corrections,
}

impl FrameSource for Corrected<'_> {
    fn channels(&self) -> usize {
        self.input.channels()
    }

    fn frames(&self) -> usize {
        self.input.frames()
    }

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        self.input.load_f32(isa, first, samples);
        self.corrections.single.subtract(samples);
    }

    fn load_f64(&self, isa: Isa, first: usize, samples: &mut [f64]) {
        self.input.load_f64(isa, first, samples);
        self.corrections.double.subtract(samples);
    }
}
