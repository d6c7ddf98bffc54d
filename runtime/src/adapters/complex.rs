//! The real or the imaginary parts of complex samples in memory.

use super::{Input, Output};
use crate::{Isa, Sample};

/// Which part.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Part {
    Real = 0,
    Imaginary = 1,
}

/// One part of frames of N complex samples, real part first.
pub(crate) struct ComplexInput<'a, S> {
    pub(crate) samples: &'a [[S; 2]],
    /// N.
    pub(crate) channels: usize,
    pub(crate) part: Part,
}

impl<S: Sample> Input for ComplexInput<'_, S> {
    fn channels(&self) -> usize {
        self.channels
    }

    fn frames(&self) -> usize {
        self.samples.len() / self.channels
    }

    fn load<T: Sample>(&self, _: Isa, first: usize, samples: &mut [T]) {
        for (slot, value) in samples.iter_mut().zip(&self.samples[first * self.channels..]) {
            *slot = T::from_f64(value[self.part as usize].to_f64());
        }
    }
}

/// One part of complex samples.
pub(crate) struct ComplexOutput<'a, S> {
    pub(crate) samples: &'a mut [[S; 2]],
    pub(crate) part: Part,
}

impl<S: Sample> Output for ComplexOutput<'_, S> {
    fn capacity(&self) -> usize {
        self.samples.len()
    }

    fn store<T: Sample>(&mut self, _: Isa, first: usize, samples: &[T]) {
        for (slot, value) in self.samples[first..].iter_mut().zip(samples) {
            slot[self.part as usize] = S::from_f64(value.to_f64());
        }
    }
}
