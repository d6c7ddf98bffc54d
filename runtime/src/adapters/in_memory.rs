//! Samples in memory, frame after frame or channel after channel.

use super::{Input, MOST_ROWS, Output, SplitOutput, convert, interleave_rows};
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

/// A slice for each channel: sample of channel i in frame k at `[i][k]`.
#[derive(Debug, Clone, Copy)]
pub struct Planar<'a, S> {
    channels: &'a [&'a [S]],
    frames: usize,
}

impl<'a, S: Sample> Planar<'a, S> {
    /// # Errors
    /// [`ProcessError::UnequalChannels`] if the channels differ in length.
    pub fn new(channels: &'a [&'a [S]]) -> Result<Self, ProcessError> {
        let frames = channels.first().map_or(0, |first| first.len());
        match channels.iter().position(|channel| channel.len() != frames) {
            Some(channel) => Err(ProcessError::UnequalChannels {
                first: frames,
                channel,
                samples: channels[channel].len(),
            }),
            None => Ok(Self { channels, frames }),
        }
    }
}

impl<S: Sample> Input for Planar<'_, S> {
    fn channels(&self) -> usize {
        self.channels.len()
    }

    fn frames(&self) -> usize {
        self.frames
    }

    /// One channel is interleaved as it lies.
    fn in_memory<T: Sample>(&self) -> Option<&[T]> {
        match self.channels {
            [alone] => same(alone),
            _ => None,
        }
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.channels
            .iter()
            .all(|channel| channel[frames.clone()].iter().all(|sample| sample.to_f64().is_finite()))
    }

    fn load<T: Sample>(&self, isa: Isa, first: usize, samples: &mut [T]) {
        let n = self.channels.len();
        match same_mut::<T, f32>(samples) {
            Some(samples) if n <= MOST_ROWS => interleave_rows(isa, n, samples, |i, start, row| {
                convert(&self.channels[i][first + start..][..row.len()], row);
            }),
            _ => {
                for (k, frame) in (first..).zip(samples.chunks_exact_mut(n)) {
                    for (slot, channel) in frame.iter_mut().zip(self.channels) {
                        *slot = T::from_f64(channel[k].to_f64());
                    }
                }
            }
        }
    }
}
