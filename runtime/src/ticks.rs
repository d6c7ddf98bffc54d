//! Samples of a call, wherever and however they lie, to and from frames of the kernels' number type.

use super::sample::Sample;
use super::simd::{Isa, decode, encode, interleave};
use crate::pcm::for_pcm_format;
use crate::{PcmFormat, PcmFrames};
use std::ops::Range;

/// Room for fast samples, and what was lost on the way in.
#[derive(Debug)]
pub struct PcmOutput<'a> {
    /// How samples are to be stored.
    pub format: PcmFormat,
    /// M samples a tick.
    pub bytes: &'a mut [u8],
    /// Samples that were clipped, added to by every call.
    pub clipped: u64,
}

/// Samples on their way between types; stays in the first-level cache.
const SCRATCH: usize = 1024;

/// Gives frames of N samples.
pub(crate) trait TickSource: Sync {
    fn channels(&self) -> usize;
    fn ticks(&self) -> usize;
    /// All frames as they lie in memory, if they are of this type.
    fn frames<T: Sample>(&self) -> Option<&[T]> {
        None
    }
    /// Ticks `first..first + ticks` as frames; whether they are finite is not looked at.
    fn gather<T: Sample>(&self, isa: Isa, first: usize, ticks: usize, frames: &mut [T]);
    /// A range of the ticks as a source.
    fn part<R>(&self, ticks: Range<usize>, with: impl FnOnce(&Self) -> R) -> R;
}

/// Takes fast samples.
pub(crate) trait FastSink: Send {
    /// A part of the room.
    type Half<'h>: FastSink + ?Sized
    where
        Self: 'h;
    /// Samples that fit.
    fn capacity(&self) -> usize;
    /// Where these samples go, if they are of this type.
    fn slots<T: Sample>(&mut self, _samples: Range<usize>) -> Option<&mut [T]> {
        None
    }
    /// Stores samples from sample `first` on.
    fn store<T: Sample>(&mut self, isa: Isa, first: usize, samples: &[T]);
    /// The room for the first `samples` samples and that for the others, each as a sink.
    fn halves<'h, R>(
        &'h mut self,
        samples: usize,
        with: impl FnOnce(&mut Self::Half<'h>, &mut Self::Half<'h>) -> R,
    ) -> R;
}

/// Numbers in memory, frames of N.
pub(crate) struct Interleaved<'a, S> {
    samples: &'a [S],
    channels: usize,
    /// Divided once: short calls would notice.
    ticks: usize,
}

impl<'a, S> Interleaved<'a, S> {
    /// `None` if there is a part of a frame.
    pub(crate) fn new(samples: &'a [S], channels: usize) -> Option<Self> {
        let ticks = samples.len() / channels;
        (ticks * channels == samples.len()).then_some(Self { samples, channels, ticks })
    }
}

impl<S: Sample> TickSource for Interleaved<'_, S> {
    fn channels(&self) -> usize {
        self.channels
    }

    fn ticks(&self) -> usize {
        self.ticks
    }

    fn frames<T: Sample>(&self) -> Option<&[T]> {
        T::same(self.samples)
    }

    fn gather<T: Sample>(&self, _: Isa, first: usize, ticks: usize, frames: &mut [T]) {
        convert(&self.samples[first * self.channels..(first + ticks) * self.channels], frames);
    }

    fn part<R>(&self, ticks: Range<usize>, with: impl FnOnce(&Self) -> R) -> R {
        let samples = &self.samples[ticks.start * self.channels..ticks.end * self.channels];
        with(&Interleaved { samples, channels: self.channels, ticks: ticks.len() })
    }
}

/// The same numbers in another type.
fn convert<S: Sample, T: Sample>(from: &[S], to: &mut [T]) {
    if let Some(same) = T::same(from) {
        to.copy_from_slice(same);
        return;
    }
    for (slot, value) in to.iter_mut().zip(from) {
        *slot = T::from_f64(value.to_f64());
    }
}

/// Several recordings side by side: their channels follow each other.
impl TickSource for [PcmFrames<'_>] {
    fn channels(&self) -> usize {
        self.iter().map(|part| part.channels).sum()
    }

    fn ticks(&self) -> usize {
        self.iter().map(PcmFrames::frames).min().unwrap_or(0)
    }

    fn gather<T: Sample>(&self, isa: Isa, first: usize, ticks: usize, frames: &mut [T]) {
        if let [part] = self {
            return gather_part(isa, part, first, frames);
        }
        let n = self.channels();
        let mono = self.iter().all(|part| part.channels == 1);
        match T::as_f32_mut(frames) {
            Some(frames) if mono && 8 * n <= SCRATCH => gather_mono(isa, self, first, ticks, frames),
            _ => gather_each(self, first, frames),
        }
    }

    fn part<R>(&self, ticks: Range<usize>, with: impl FnOnce(&Self) -> R) -> R {
        let parts: Vec<_> = self.iter().map(|part| part.range(ticks.clone())).collect();
        with(&parts)
    }
}

/// All channels from one recording.
fn gather_part<T: Sample>(isa: Isa, part: &PcmFrames<'_>, first: usize, frames: &mut [T]) {
    let packed = part.layout.container == part.layout.format.bytes();
    let done = match T::as_f32_mut(frames) {
        Some(frames) if packed => {
            decode(isa, part.layout.format, &part.bytes[first * part.frame_bytes()..], frames)
        }
        _ => 0,
    };
    // Whole frames only; the rest one by one.
    let done = done / part.channels;
    gather_columns(part, first + done, part.channels, &mut frames[done * part.channels..]);
}

/// One channel from each recording: rows first, then frames from rows.
fn gather_mono(isa: Isa, parts: &[PcmFrames<'_>], first: usize, ticks: usize, frames: &mut [f32]) {
    let n = parts.len();
    let mut rows = [0f32; SCRATCH];
    let step = SCRATCH / n / 8 * 8;
    for start in (0..ticks).step_by(step) {
        let count = step.min(ticks - start);
        for (row, part) in rows.chunks_exact_mut(step).zip(parts) {
            gather_part(isa, part, first + start, &mut row[..count]);
        }
        let out = &mut frames[start * n..(start + count) * n];
        for t in interleave(isa, &rows, step, n, count, out)..count {
            (0..n).for_each(|i| out[t * n + i] = rows[i * step + t]);
        }
    }
}

/// Any recordings, sample by sample.
fn gather_each<T: Sample>(parts: &[PcmFrames<'_>], first: usize, frames: &mut [T]) {
    let n = parts.iter().map(|part| part.channels).sum();
    let mut offset = 0;
    for part in parts {
        gather_columns(part, first, n, &mut frames[offset..]);
        offset += part.channels;
    }
}

/// The channels of a recording to the first columns of frames of `n` samples (the last may be cut behind
/// them).
fn gather_columns<T: Sample>(part: &PcmFrames<'_>, first: usize, n: usize, frames: &mut [T]) {
    let container = part.layout.container;
    let bytes = part.bytes.chunks_exact(part.frame_bytes()).skip(first);
    for_pcm_format!(part.layout.format, FORMAT => {
        for (frame, bytes) in frames.chunks_mut(n).zip(bytes) {
            for (slot, sample) in frame[..part.channels].iter_mut().zip(bytes.chunks_exact(container)) {
                *slot = T::from_f64(FORMAT.decode(sample));
            }
        }
    });
}

impl<S: Sample> FastSink for [S] {
    type Half<'h> = [S];

    fn capacity(&self) -> usize {
        self.len()
    }

    fn slots<T: Sample>(&mut self, samples: Range<usize>) -> Option<&mut [T]> {
        T::same_mut(&mut self[samples])
    }

    fn store<T: Sample>(&mut self, _: Isa, first: usize, samples: &[T]) {
        convert(samples, &mut self[first..first + samples.len()]);
    }

    fn halves<'h, R>(
        &'h mut self,
        samples: usize,
        with: impl FnOnce(&mut Self::Half<'h>, &mut Self::Half<'h>) -> R,
    ) -> R {
        let (earlier, later) = self.split_at_mut(samples);
        with(earlier, later)
    }
}

impl FastSink for PcmOutput<'_> {
    type Half<'h>
        = PcmOutput<'h>
    where
        Self: 'h;

    fn capacity(&self) -> usize {
        self.bytes.len() / self.format.bytes()
    }

    fn store<T: Sample>(&mut self, isa: Isa, first: usize, samples: &[T]) {
        let size = self.format.bytes();
        let out = &mut self.bytes[first * size..(first + samples.len()) * size];
        self.clipped += match T::as_f32(samples) {
            Some(samples) => encode(isa, self.format, samples, out),
            None if size < 4 => encode_by_scratch(isa, self.format, samples, out),
            // Formats that hold more digits than f32.
            None => encode_each(self.format, samples, out),
        };
    }

    fn halves<'h, R>(
        &'h mut self,
        samples: usize,
        with: impl FnOnce(&mut Self::Half<'h>, &mut Self::Half<'h>) -> R,
    ) -> R {
        let Self { format, bytes, clipped } = self;
        let (earlier, later) = bytes.split_at_mut(samples * format.bytes());
        let half = |bytes| PcmOutput { format: *format, bytes, clipped: 0 };
        let (mut earlier, mut later) = (half(earlier), half(later));
        let result = with(&mut earlier, &mut later);
        *clipped += earlier.clipped + later.clipped;
        result
    }
}

/// Rounded to f32 first, which formats of few digits do not notice.
fn encode_by_scratch<T: Sample>(isa: Isa, format: PcmFormat, samples: &[T], out: &mut [u8]) -> u64 {
    let mut scratch = [0f32; SCRATCH];
    let parts = samples.chunks(SCRATCH).zip(out.chunks_mut(SCRATCH * format.bytes()));
    parts
        .map(|(samples, out)| {
            let scratch = &mut scratch[..samples.len()];
            convert(samples, scratch);
            encode(isa, format, scratch, out)
        })
        .sum()
}

/// Sample by sample; returns how many were clipped.
fn encode_each<T: Sample>(format: PcmFormat, samples: &[T], out: &mut [u8]) -> u64 {
    let mut clipped = 0;
    for_pcm_format!(format, FORMAT => {
        for (slot, value) in out.chunks_exact_mut(FORMAT.bytes()).zip(samples) {
            clipped += u64::from(FORMAT.encode(value.to_f64(), slot));
        }
    });
    clipped
}
