//! Samples in memory, frame after frame or channel after channel.

use super::{FrameSink, FrameSource, Halves, SplitOutput, convert};
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

    /// The whole frames at the beginning.
    pub fn whole(samples: &'a [S], channels: usize) -> Self {
        let frames = samples.len().checked_div(channels).unwrap_or(0);
        Self { samples: &samples[..frames * channels], channels, frames }
    }

    /// All samples, frame after frame.
    pub fn samples(&self) -> &'a [S] {
        self.samples
    }
}

impl<S: Sample> FrameSource for Interleaved<'_, S> {
    fn channels(&self) -> usize {
        self.channels
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn in_memory_f32(&self) -> Option<&[f32]> {
        same(self.samples)
    }

    fn in_memory_f64(&self) -> Option<&[f64]> {
        same(self.samples)
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        let samples = &self.samples[frames.start * self.channels..frames.end * self.channels];
        samples.iter().all(|sample| sample.to_f64().is_finite())
    }

    fn load_f32(&self, _: Isa, first: usize, samples: &mut [f32]) {
        convert(&self.samples[first * self.channels..][..samples.len()], samples);
    }

    fn load_f64(&self, _: Isa, first: usize, samples: &mut [f64]) {
        convert(&self.samples[first * self.channels..][..samples.len()], samples);
    }
}

impl<S: Sample> FrameSink for &mut [S] {
    fn capacity(&self) -> usize {
        self.len()
    }

    fn slots_f32(&mut self, samples: Range<usize>) -> Option<&mut [f32]> {
        same_mut(&mut self[samples])
    }

    fn slots_f64(&mut self, samples: Range<usize>) -> Option<&mut [f64]> {
        same_mut(&mut self[samples])
    }

    fn store_f32(&mut self, _: Isa, first: usize, samples: &[f32]) {
        convert(samples, &mut self[first..first + samples.len()]);
    }

    fn store_f64(&mut self, _: Isa, first: usize, samples: &[f64]) {
        convert(samples, &mut self[first..first + samples.len()]);
    }
}

impl<S: Sample> SplitOutput for &mut [S] {
    fn halves(&mut self, samples: usize, with: Halves<'_>) {
        let (mut earlier, mut later) = self.split_at_mut(samples);
        with(&mut earlier, &mut later);
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

    /// One channel is interleaved as it lies.
    fn alone(&self) -> Option<&[S]> {
        if let [alone] = self.channels { Some(alone) } else { None }
    }

    fn load_each<T: Sample>(&self, first: usize, samples: &mut [T]) {
        let n = self.channels.len();
        for (i, channel) in self.channels.iter().enumerate() {
            let slots = samples.iter_mut().skip(i).step_by(n);
            slots.zip(&channel[first..]).for_each(|(slot, x)| *slot = T::from_f64(x.to_f64()));
        }
    }
}

impl<S: Sample> FrameSource for Planar<'_, S> {
    fn channels(&self) -> usize {
        self.channels.len()
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn in_memory_f32(&self) -> Option<&[f32]> {
        self.alone().and_then(same)
    }

    fn in_memory_f64(&self) -> Option<&[f64]> {
        self.alone().and_then(same)
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.channels
            .iter()
            .all(|channel| channel[frames.clone()].iter().all(|sample| sample.to_f64().is_finite()))
    }

    fn load_f32(&self, _: Isa, first: usize, samples: &mut [f32]) {
        self.load_each(first, samples);
    }

    fn load_f64(&self, _: Isa, first: usize, samples: &mut [f64]) {
        self.load_each(first, samples);
    }
}
