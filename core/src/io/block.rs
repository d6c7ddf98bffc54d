//! Blocks of frames as numbers, between the thread of an input and its consumer.
//!
//! Samples are decoded once, at the door: to f32 where it holds all their digits, to f64 elsewhere. The real
//! and the imaginary parts of complex samples lie apart, each frame after frame.

use super::{StreamHeader, TimeInterleaving};
use crate::runtime::{FrameSource, Interleaved, Isa, PcmFrames, Precision, Sample, SampleLayout};
use std::collections::TryReserveError;
use std::ops::Range;

/// Numbers of one kind.
#[derive(Debug, Clone)]
pub(super) enum Numbers {
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Calls a generic expression with the numbers.
macro_rules! with_numbers {
    ($numbers:expr, $name:ident => $body:expr) => {
        match $numbers {
            Numbers::F32($name) => $body,
            Numbers::F64($name) => $body,
        }
    };
}

pub(super) use with_numbers;

impl Numbers {
    /// None, of the kind that holds the digits of samples stored so.
    fn of(layout: SampleLayout) -> Self {
        match Precision::of(layout.format) {
            Precision::Single => Self::F32(Vec::new()),
            Precision::Double => Self::F64(Vec::new()),
        }
    }

    fn len(&self) -> usize {
        with_numbers!(self, numbers => numbers.len())
    }

    /// Those of a range, as frames of so many channels.
    fn frames(&self, range: Range<usize>, channels: usize) -> NumberFrames<'_> {
        match self {
            Self::F32(numbers) => NumberFrames::F32(Interleaved::whole(&numbers[range], channels)),
            Self::F64(numbers) => NumberFrames::F64(Interleaved::whole(&numbers[range], channels)),
        }
    }
}

/// Whole frames of an input.
#[derive(Debug, Default)]
pub(super) struct Block {
    channels: usize,
    /// One, or the real and the imaginary parts.
    pub(super) parts: Vec<Numbers>,
}

impl Block {
    /// Makes the block an empty one for frames of an input with this header; its memory stays.
    pub(super) fn begin(&mut self, header: &StreamHeader) {
        let empty = Numbers::of(header.layout);
        let is_same = |part: &Numbers| std::mem::discriminant(part) == std::mem::discriminant(&empty);
        if self.parts.len() != header.parts() || !self.parts.iter().all(is_same) {
            self.parts = vec![empty; header.parts()];
        }
        self.channels = header.channels;
        self.parts.iter_mut().for_each(|part| with_numbers!(part, numbers => numbers.clear()));
    }

    /// So many frames of missing samples.
    pub(super) fn missing(header: &StreamHeader, frames: usize) -> Self {
        let mut block = Self::default();
        block.begin(header);
        block.extend_missing(frames);
        block
    }

    /// Numbers of a frame; of complex samples those of a part.
    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    /// Frames.
    pub(super) fn frames(&self) -> usize {
        self.parts.first().map_or(0, |part| part.len() / self.channels.max(1))
    }

    /// Appends frames as they are stored; the parts of complex samples are channels of `frames` in turn.
    pub(super) fn decode(&mut self, frames: &PcmFrames<'_>) -> Result<(), TryReserveError> {
        if let [real] = &mut self.parts[..] {
            return append(frames, real);
        }
        self.parts.iter_mut().enumerate().try_for_each(|(k, part)| append(&frames.part(k), part))
    }

    /// Appends frames of numbers; those of the parts of complex samples take turns.
    pub(super) fn extend(&mut self, more: impl IntoIterator<Item = f64>) {
        let parts = self.parts.len().max(1);
        for (k, x) in more.into_iter().enumerate() {
            match &mut self.parts[k % parts] {
                Numbers::F32(numbers) => numbers.push(x as f32),
                Numbers::F64(numbers) => numbers.push(x),
            }
        }
    }

    /// Appends the frames of another block of the same kind.
    pub(super) fn append(&mut self, more: &Self, frames: Range<usize>) {
        let range = frames.start * self.channels..frames.end * self.channels;
        for (part, more) in self.parts.iter_mut().zip(&more.parts) {
            match (part, more) {
                (Numbers::F32(numbers), Numbers::F32(more)) => {
                    numbers.extend_from_slice(&more[range.clone()])
                }
                (Numbers::F64(numbers), Numbers::F64(more)) => {
                    numbers.extend_from_slice(&more[range.clone()])
                }
                _ => {}
            }
        }
    }

    /// Appends frames of missing samples.
    pub(super) fn extend_missing(&mut self, frames: usize) {
        for part in &mut self.parts {
            let length = part.len() + frames * self.channels;
            match part {
                Numbers::F32(numbers) => numbers.resize(length, f32::NAN),
                Numbers::F64(numbers) => numbers.resize(length, f64::NAN),
            }
        }
    }

    /// Marks the samples of a channel in some frames as missing.
    pub(super) fn lose(&mut self, channel: usize, frames: Range<usize>) {
        for part in &mut self.parts {
            with_numbers!(part, numbers => {
                let slots = numbers.iter_mut().skip(frames.start * self.channels + channel);
                slots.step_by(self.channels).take(frames.len()).for_each(|slot| *slot = Sample::from_f64(f64::NAN));
            });
        }
    }

    /// Leaves out all frames from this one on.
    pub(super) fn truncate(&mut self, frames: usize) {
        let length = frames * self.channels;
        self.parts.iter_mut().for_each(|part| with_numbers!(part, numbers => numbers.truncate(length)));
    }

    /// Makes the samples of time-interleaved converters, one channel so far, frames of all of them.
    pub(super) fn take_turns(&mut self, interleaving: &TimeInterleaving) {
        self.channels = interleaving.converters();
        self.parts.iter_mut().for_each(|part| with_numbers!(part, numbers => interleaving.reorder(numbers)));
    }

    /// Keeps one channel only.
    pub(super) fn keep(&mut self, channel: usize) {
        let channels = std::mem::replace(&mut self.channels, 1);
        for part in self.parts.iter_mut().filter(|_| channels > 1) {
            with_numbers!(part, numbers => {
                let count = numbers.len() / channels;
                (0..count).for_each(|k| numbers[k] = numbers[k * channels + channel]);
                numbers.truncate(count);
            });
        }
    }

    /// Some of the frames. Several samples of each channel in a row may be a frame.
    pub(super) fn view(&self, frames: Range<usize>, per_frame: usize) -> RecordedFrames<'_> {
        let range = frames.start * self.channels..frames.end * self.channels;
        let part = |k: usize| Some(self.parts.get(k)?.frames(range.clone(), self.channels * per_frame));
        let none = NumberFrames::F64(Interleaved::whole(&[], self.channels));
        RecordedFrames { real: part(0).unwrap_or(none), imaginary: part(1) }
    }
}

/// Appends the samples of frames.
fn append(frames: &PcmFrames<'_>, to: &mut Numbers) -> Result<(), TryReserveError> {
    let (begin, more) = (to.len(), frames.frames() * frames.channels);
    with_numbers!(to, numbers => {
        numbers.try_reserve(more)?;
        numbers.resize(begin + more, Sample::from_f64(0.0));
        (frames as &dyn FrameSource).load(Isa::detect(), 0, &mut numbers[begin..]);
    });
    Ok(())
}

/// Whole frames of one recording.
#[derive(Debug, Clone, Copy)]
pub struct RecordedFrames<'a> {
    /// The samples, or the real parts of complex ones.
    pub real: NumberFrames<'a>,
    /// The imaginary parts of complex samples.
    pub imaginary: Option<NumberFrames<'a>>,
}

impl<'a> RecordedFrames<'a> {
    /// The samples, or their parts.
    pub fn parts(&self) -> impl Iterator<Item = NumberFrames<'a>> {
        std::iter::once(self.real).chain(self.imaginary)
    }

    /// Frames.
    pub fn frames(&self) -> usize {
        self.real.frames()
    }
}

/// Frames of numbers: f32 of samples whose digits it holds, f64 of others.
#[derive(Debug, Clone, Copy)]
pub enum NumberFrames<'a> {
    /// Of up to 24 bits, and single floats.
    F32(Interleaved<'a, f32>),
    /// Of others.
    F64(Interleaved<'a, f64>),
}

impl<'a> NumberFrames<'a> {
    /// The numbers of a channel.
    pub fn channel(self, channel: usize) -> Box<dyn Iterator<Item = f64> + 'a> {
        let step = self.channels().max(1);
        match self {
            Self::F32(frames) => {
                Box::new(frames.samples().iter().skip(channel).step_by(step).map(|x| f64::from(*x)))
            }
            Self::F64(frames) => Box::new(frames.samples().iter().skip(channel).step_by(step).copied()),
        }
    }

    fn input(&self) -> &dyn FrameSource {
        match self {
            Self::F32(frames) => frames,
            Self::F64(frames) => frames,
        }
    }
}

impl FrameSource for NumberFrames<'_> {
    fn channels(&self) -> usize {
        self.input().channels()
    }

    fn frames(&self) -> usize {
        self.input().frames()
    }

    fn in_memory_f32(&self) -> Option<&[f32]> {
        self.input().in_memory_f32()
    }

    fn in_memory_f64(&self) -> Option<&[f64]> {
        self.input().in_memory_f64()
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.input().is_finite(frames)
    }

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        self.input().load_f32(isa, first, samples);
    }

    fn load_f64(&self, isa: Isa, first: usize, samples: &mut [f64]) {
        self.input().load_f64(isa, first, samples);
    }
}
