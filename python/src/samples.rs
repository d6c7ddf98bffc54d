//! Samples in the memory of arrays, as the runtime reads and writes them.
//!
//! One type for all layouts and number types, so that the kernels are compiled once.

use hybank::runtime::{Input, Interleaved, Isa, Output, PcmFrames, PcmOutput, Sample, SplitOutput};
use std::ops::Range;

/// Frames of N samples.
pub(crate) enum Samples<'a> {
    Interleaved32(Interleaved<'a, f32>),
    Interleaved64(Interleaved<'a, f64>),
    /// A row for each channel, integers, or one part of complex samples.
    Pcm(Vec<PcmFrames<'a>>),
}

impl Input for Samples<'_> {
    fn channels(&self) -> usize {
        match self {
            Self::Interleaved32(frames) => frames.channels(),
            Self::Interleaved64(frames) => frames.channels(),
            Self::Pcm(parts) => parts[..].channels(),
        }
    }

    fn frames(&self) -> usize {
        match self {
            Self::Interleaved32(frames) => frames.frames(),
            Self::Interleaved64(frames) => frames.frames(),
            Self::Pcm(parts) => parts[..].frames(),
        }
    }

    fn in_memory<T: Sample>(&self) -> Option<&[T]> {
        match self {
            Self::Interleaved32(frames) => frames.in_memory(),
            Self::Interleaved64(frames) => frames.in_memory(),
            _ => None,
        }
    }

    fn is_finite(&self, range: Range<usize>) -> bool {
        match self {
            Self::Interleaved32(frames) => frames.is_finite(range),
            Self::Interleaved64(frames) => frames.is_finite(range),
            Self::Pcm(parts) => parts[..].is_finite(range),
        }
    }

    fn load<T: Sample>(&self, isa: Isa, first: usize, samples: &mut [T]) {
        match self {
            Self::Interleaved32(frames) => frames.load(isa, first, samples),
            Self::Interleaved64(frames) => frames.load(isa, first, samples),
            Self::Pcm(parts) => parts[..].load(isa, first, samples),
        }
    }
}

/// Room for output samples.
pub(crate) enum Room<'a> {
    F32(&'a mut [f32]),
    F64(&'a mut [f64]),
    /// Integers, or parts of complex samples.
    Pcm(PcmOutput<'a>),
}

impl Output for Room<'_> {
    fn capacity(&self) -> usize {
        match self {
            Self::F32(room) => room.len(),
            Self::F64(room) => room.len(),
            Self::Pcm(room) => room.capacity(),
        }
    }

    fn select(&mut self, part: usize) {
        if let Self::Pcm(room) = self {
            room.select(part);
        }
    }

    fn slots<T: Sample>(&mut self, samples: Range<usize>) -> Option<&mut [T]> {
        match self {
            Self::F32(room) => room.slots(samples),
            Self::F64(room) => room.slots(samples),
            _ => None,
        }
    }

    fn store<T: Sample>(&mut self, isa: Isa, first: usize, samples: &[T]) {
        match self {
            Self::F32(room) => room.store(isa, first, samples),
            Self::F64(room) => room.store(isa, first, samples),
            Self::Pcm(room) => room.store(isa, first, samples),
        }
    }
}

impl SplitOutput for Room<'_> {
    type Half<'h>
        = Room<'h>
    where
        Self: 'h;

    fn halves<'h, R>(
        &'h mut self,
        samples: usize,
        with: impl FnOnce(&mut Self::Half<'h>, &mut Self::Half<'h>) -> R,
    ) -> R {
        match self {
            Self::F32(room) => {
                let (earlier, later) = room.split_at_mut(samples);
                with(&mut Room::F32(earlier), &mut Room::F32(later))
            }
            Self::F64(room) => {
                let (earlier, later) = room.split_at_mut(samples);
                with(&mut Room::F64(earlier), &mut Room::F64(later))
            }
            Self::Pcm(room) => {
                let ([earlier, later], clipped) = room.split(samples);
                let (mut earlier, mut later) = (Room::Pcm(earlier), Room::Pcm(later));
                let result = with(&mut earlier, &mut later);
                *clipped += earlier.clipped() + later.clipped();
                result
            }
        }
    }
}

impl Room<'_> {
    /// Samples that saturated.
    pub(crate) fn clipped(&self) -> u64 {
        if let Self::Pcm(room) = self { room.clipped } else { 0 }
    }
}
