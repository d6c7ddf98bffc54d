//! Samples in the memory of arrays, as the runtime reads and writes them.
//!
//! One type for all layouts and number types, so that the kernels are compiled once.

use hybank::runtime::{Input, Interleaved, Isa, Output, PcmFrames, PcmOutput, Planar, Sample, SplitOutput};
use std::ops::Range;

/// Frames of N samples.
pub(crate) enum Samples<'a> {
    Interleaved32(Interleaved<'a, f32>),
    Interleaved64(Interleaved<'a, f64>),
    /// A row for each channel.
    Planar32(Vec<&'a [f32]>),
    Planar64(Vec<&'a [f64]>),
    /// Integers.
    Pcm(Vec<PcmFrames<'a>>),
    Part32(Part<'a, f32>),
    Part64(Part<'a, f64>),
}

/// The real or the imaginary parts of complex samples; steps count complex samples.
#[derive(Clone, Copy)]
pub(crate) struct Part<'a, S> {
    /// Real and imaginary parts in turn.
    pub(crate) numbers: &'a [S],
    /// 0 or 1.
    pub(crate) part: usize,
    pub(crate) frame_step: usize,
    pub(crate) channel_step: usize,
    pub(crate) channels: usize,
    pub(crate) frames: usize,
}

impl<S: Sample> Part<'_, S> {
    fn load<T: Sample>(&self, first: usize, samples: &mut [T]) {
        for (k, frame) in (first..).zip(samples.chunks_exact_mut(self.channels)) {
            for (i, slot) in frame.iter_mut().enumerate() {
                let place = 2 * (k * self.frame_step + i * self.channel_step) + self.part;
                *slot = T::from_f64(self.numbers[place].to_f64());
            }
        }
    }
}

impl Samples<'_> {
    /// Of complex samples, from now on the real parts (0) or the imaginary parts (1).
    pub(crate) fn select(&mut self, part: usize) {
        match self {
            Self::Part32(samples) => samples.part = part,
            Self::Part64(samples) => samples.part = part,
            _ => {}
        }
    }
}

impl Input for Samples<'_> {
    fn channels(&self) -> usize {
        match self {
            Self::Interleaved32(frames) => frames.channels(),
            Self::Interleaved64(frames) => frames.channels(),
            Self::Planar32(rows) => rows.len(),
            Self::Planar64(rows) => rows.len(),
            Self::Pcm(parts) => parts[..].channels(),
            Self::Part32(part) => part.channels,
            Self::Part64(part) => part.channels,
        }
    }

    fn frames(&self) -> usize {
        match self {
            Self::Interleaved32(frames) => frames.frames(),
            Self::Interleaved64(frames) => frames.frames(),
            Self::Planar32(rows) => rows.first().map_or(0, |row| row.len()),
            Self::Planar64(rows) => rows.first().map_or(0, |row| row.len()),
            Self::Pcm(parts) => parts[..].frames(),
            Self::Part32(part) => part.frames,
            Self::Part64(part) => part.frames,
        }
    }

    fn in_memory<T: Sample>(&self) -> Option<&[T]> {
        match self {
            Self::Interleaved32(frames) => frames.in_memory(),
            Self::Interleaved64(frames) => frames.in_memory(),
            _ => None,
        }
    }

    fn load<T: Sample>(&self, isa: Isa, first: usize, samples: &mut [T]) {
        match self {
            Self::Interleaved32(frames) => frames.load(isa, first, samples),
            Self::Interleaved64(frames) => frames.load(isa, first, samples),
            Self::Planar32(rows) => load_rows(isa, rows, first, samples),
            Self::Planar64(rows) => load_rows(isa, rows, first, samples),
            Self::Pcm(parts) => parts[..].load(isa, first, samples),
            Self::Part32(part) => part.load(first, samples),
            Self::Part64(part) => part.load(first, samples),
        }
    }
}

fn load_rows<S: Sample, T: Sample>(isa: Isa, rows: &[&[S]], first: usize, samples: &mut [T]) {
    // The rows of an array have one length.
    if let Ok(planar) = Planar::new(rows) {
        planar.load(isa, first, samples);
    }
}

/// Room for output samples.
pub(crate) enum Room<'a> {
    F32(&'a mut [f32]),
    F64(&'a mut [f64]),
    Pcm(PcmOutput<'a>),
    /// The real (0) or imaginary (1) parts of complex samples.
    Part32(&'a mut [f32], usize),
    Part64(&'a mut [f64], usize),
}

impl Output for Room<'_> {
    fn capacity(&self) -> usize {
        match self {
            Self::F32(room) => room.len(),
            Self::F64(room) => room.len(),
            Self::Pcm(room) => room.capacity(),
            Self::Part32(room, _) => room.len() / 2,
            Self::Part64(room, _) => room.len() / 2,
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
            Self::Part32(room, part) => store_part(room, *part, first, samples),
            Self::Part64(room, part) => store_part(room, *part, first, samples),
        }
    }
}

fn store_part<S: Sample, T: Sample>(room: &mut [S], part: usize, first: usize, samples: &[T]) {
    // Where there is no sample, there is no room for a second part either.
    let room = room.get_mut(2 * first + part..).unwrap_or_default();
    for (slot, value) in room.iter_mut().step_by(2).zip(samples) {
        *slot = S::from_f64(value.to_f64());
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
            Self::Pcm(room) => pcm_halves(room, samples, with),
            Self::Part32(room, part) => {
                let (earlier, later) = room.split_at_mut(2 * samples);
                with(&mut Room::Part32(earlier, *part), &mut Room::Part32(later, *part))
            }
            Self::Part64(room, part) => {
                let (earlier, later) = room.split_at_mut(2 * samples);
                with(&mut Room::Part64(earlier, *part), &mut Room::Part64(later, *part))
            }
        }
    }
}

fn pcm_halves<'h, R>(
    room: &'h mut PcmOutput<'_>,
    samples: usize,
    with: impl FnOnce(&mut Room<'h>, &mut Room<'h>) -> R,
) -> R {
    let format = room.layout.format;
    let (earlier, later) = room.bytes.split_at_mut(samples * format.bytes());
    let half = |bytes| Room::Pcm(PcmOutput::packed(format, bytes));
    let (mut earlier, mut later) = (half(earlier), half(later));
    let result = with(&mut earlier, &mut later);
    room.clipped += earlier.clipped() + later.clipped();
    result
}

impl Room<'_> {
    /// Of complex samples, from now on the real parts (0) or the imaginary parts (1).
    pub(crate) fn select(&mut self, which: usize) {
        if let Self::Part32(_, part) | Self::Part64(_, part) = self {
            *part = which;
        }
    }

    /// Samples that saturated.
    pub(crate) fn clipped(&self) -> u64 {
        if let Self::Pcm(room) = self { room.clipped } else { 0 }
    }
}
