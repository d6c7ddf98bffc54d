//! The offsets and the static nonlinearities of the converters, subtracted from the samples on their way to
//! the kernels.

use super::FrameSource;
use super::nonlinearity::{Nonlinearity, polynomial};
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
    /// The tables of the channels, empty of those that have none; nothing if none has one.
    tables: Vec<Vec<T>>,
}

impl Corrections {
    /// `None` if nothing is to be subtracted.
    ///
    /// # Errors
    /// [`BuildError::OffsetCount`] unless there is an offset for each of N = `channels`, and a nonlinearity
    /// unless there is none at all; [`BuildError::NotFinite`].
    pub(crate) fn new(
        offsets: &[f64],
        nonlinearity: &[Nonlinearity],
        channels: usize,
    ) -> Result<Option<Self>, BuildError> {
        if offsets.len() != channels {
            return Err(BuildError::OffsetCount { offsets: offsets.len(), channels });
        }
        if !nonlinearity.is_empty() && nonlinearity.len() != channels {
            return Err(BuildError::OffsetCount { offsets: nonlinearity.len(), channels });
        }
        check_finite("the offsets of the channels", offsets)?;
        let of = |one: &Nonlinearity| check_finite("the nonlinearity of a channel", one.values());
        nonlinearity.iter().try_for_each(of)?;
        let lists: Vec<&[f64]> = nonlinearity.iter().map(coefficients).collect();
        let count = lists.iter().map(|list| list.len()).max().unwrap_or(0);
        let of_order = |k: usize| lists.iter().map(move |list| list.get(k).copied().unwrap_or(0.0));
        let orders: Vec<Vec<f64>> = (0..count).map(|k| of_order(k).collect()).collect();
        let tables: Vec<Vec<f64>> = nonlinearity.iter().map(|one| table(one).to_vec()).collect();
        if offsets.iter().chain(orders.iter().chain(&tables).flatten()).all(|&x| x == 0.0) {
            return Ok(None);
        }
        let tables = if tables.iter().all(Vec::is_empty) { Vec::new() } else { tables };
        let repeated = |values: &[f64]| values.repeat(PATTERN.div_ceil(channels));
        let orders = orders.iter().map(|a| repeated(a)).collect();
        let double = Patterns { offsets: repeated(offsets), orders, tables };
        Ok(Some(Self { single: double.rounded(), double }))
    }
}

/// The coefficients of a polynomial.
fn coefficients(nonlinearity: &Nonlinearity) -> &[f64] {
    if let Nonlinearity::Polynomial(list) = nonlinearity { list } else { &[] }
}

/// The entries of a table.
fn table(nonlinearity: &Nonlinearity) -> &[f64] {
    if let Nonlinearity::Table { table } = nonlinearity { table } else { &[] }
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
        Patterns {
            offsets: rounded(&self.offsets),
            orders: self.orders.iter().map(rounded).collect(),
            tables: self.tables.iter().map(rounded).collect(),
        }
    }
}

impl<T: Sample> Patterns<T> {
    /// Subtracts the patterns from whole frames: first the nonlinearity at the sample as it is.
    fn subtract(&self, samples: &mut [T]) {
        for part in samples.chunks_mut(self.offsets.len()) {
            if !self.orders.is_empty() || !self.tables.is_empty() {
                part.iter_mut()
                    .enumerate()
                    .for_each(|(n, sample)| *sample = *sample - self.curve(n, *sample));
            }
            part.iter_mut().zip(&self.offsets).for_each(|(sample, &offset)| *sample = *sample - offset);
        }
    }

    /// The nonlinearity of sample n of the pattern; a converter has coefficients or a table.
    fn curve(&self, n: usize, x: T) -> T {
        match self.tables.get(n % self.tables.len().max(1)) {
            Some(table) if !table.is_empty() => table[Nonlinearity::cell(table.len(), x.to_f64())],
            _ => polynomial(self.orders.iter().map(|a| a[n]), x),
        }
    }
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
