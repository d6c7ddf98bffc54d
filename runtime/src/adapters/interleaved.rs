//! Samples in memory, frame after frame.

use super::{Input, Output, SplitOutput, convert};
use crate::sample::{same, same_mut};
use crate::{Isa, ProcessError, Sample};
use std::ops::Range;

/// Frames of N samples one after another: sample of channel i in frame k at k N + i.
#[derive(Debug, Clone, Copy)]
pub struct Interleaved<'a, S> {
    samples: &'a [S],
    channels: usize,
    /// Divided once: short calls would notice.
    frames: usize,
}

impl<'a, S: Sample> Interleaved<'a, S> {
    /// # Errors
    /// [`ProcessError::PartialFrame`] if the samples are not whole frames.
    pub fn new(samples: &'a [S], channels: usize) -> Result<Self, ProcessError> {
        let frames = samples.len().checked_div(channels).unwrap_or(0);
        if frames * channels != samples.len() {
            return Err(ProcessError::PartialFrame { samples: samples.len(), channels });
        }
        Ok(Self { samples, channels, frames })
    }
}

impl<S: Sample> Input for Interleaved<'_, S> {
    fn channels(&self) -> usize {
        self.channels
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn in_memory<T: Sample>(&self) -> Option<&[T]> {
        same(self.samples)
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        let samples = &self.samples[frames.start * self.channels..frames.end * self.channels];
        samples.iter().all(|sample| sample.to_f64().is_finite())
    }

    fn load<T: Sample>(&self, _: Isa, first: usize, samples: &mut [T]) {
        convert(&self.samples[first * self.channels..][..samples.len()], samples);
    }
}

impl<S: Sample> Output for [S] {
    fn capacity(&self) -> usize {
        self.len()
    }

    fn slots<T: Sample>(&mut self, samples: Range<usize>) -> Option<&mut [T]> {
        same_mut(&mut self[samples])
    }

    fn store<T: Sample>(&mut self, _: Isa, first: usize, samples: &[T]) {
        convert(samples, &mut self[first..first + samples.len()]);
    }
}

impl<S: Sample> SplitOutput for [S] {
    type Half<'h> = [S];

    fn halves<'h, R>(
        &'h mut self,
        samples: usize,
        with: impl FnOnce(&mut Self::Half<'h>, &mut Self::Half<'h>) -> R,
    ) -> R {
        let (earlier, later) = self.split_at_mut(samples);
        with(earlier, later)
    }
}
