//! Samples of a call, wherever and however they lie: to and from interleaved frames of the kernels' number
//! type.
//!
//! A stream takes any [`Input`] and gives to any [`Output`]; those here are [`Interleaved`] and [`Planar`]
//! samples in memory, recordings as they lie in files ([`PcmFrames`](crate::PcmFrames)), [`Zeros`], slices
//! of samples and [`PcmOutput`](crate::PcmOutput). The kernels' blocks are converted one by one, so that no
//! adapter needs memory of its own.

mod in_memory;
mod offsets;
mod pcm;

pub use in_memory::{Interleaved, Planar};
pub(crate) use offsets::{Offsets, WithoutOffsets};
pub use pcm::PcmOutput;

use crate::sample::same;
use crate::{Isa, Sample};
use std::ops::Range;

/// The input of a call: frames of N samples, one of each channel.
pub trait Input {
    /// N, samples per frame.
    fn channels(&self) -> usize;

    /// Frames of the call.
    fn frames(&self) -> usize;

    /// All samples, frame after frame, if they lie so in memory and are of type `T`. The kernels read them
    /// there.
    fn in_memory<T: Sample>(&self) -> Option<&[T]> {
        None
    }

    /// True if no sample of some frames is NaN or infinite; false where nobody looks.
    fn is_finite(&self, _frames: Range<usize>) -> bool {
        false
    }

    /// Copies frames from frame `first` on to `samples`, frame after frame: `samples.len() / N` frames, all
    /// of which are there. NaN and infinity are copied as they are. `isa` is the instruction set for
    /// conversions.
    fn load<T: Sample>(&self, isa: Isa, first: usize, samples: &mut [T]);
}

/// Where the output of a call goes: samples at the fast rate, M for each frame of the input.
pub trait Output {
    /// Samples that fit.
    fn capacity(&self) -> usize;

    /// From now on the real (0) or the imaginary (1) parts of complex samples are stored. An output for real
    /// samples has part 0 only.
    fn select(&mut self, _part: usize) {}

    /// Room for the samples of a range, if samples lie one after another in memory and are of type `T`. The
    /// kernels write them there; some may be written more than once.
    fn slots<T: Sample>(&mut self, _samples: Range<usize>) -> Option<&mut [T]> {
        None
    }

    /// Stores samples from sample `first` on. `isa` is the instruction set for conversions.
    fn store<T: Sample>(&mut self, isa: Isa, first: usize, samples: &[T]);
}

/// An output whose beginning and end may be written by two threads.
pub trait SplitOutput: Output + Send {
    /// One of the two parts.
    type Half<'h>: SplitOutput + ?Sized
    where
        Self: 'h;

    /// Calls `with` with the room for the first `samples` samples and that for all others.
    fn halves<'h, R>(
        &'h mut self,
        samples: usize,
        with: impl FnOnce(&mut Self::Half<'h>, &mut Self::Half<'h>) -> R,
    ) -> R;
}

/// Frames of zeros.
///
/// ```
/// use hybank_runtime::{Options, Plan, Stream, Zeros};
/// // The sample of the frame before.
/// let mut stream = Stream::new(&Plan::from_taps(&[vec![0.0, 1.0]], 1, 0, Options::default())?);
/// let mut output = [1.0f32; 2];
/// stream.process(&[0.5f32], &mut output[..1])?;
/// stream.run(&Zeros { channels: 1, frames: 2 }, &mut output[..])?;
/// assert_eq!(output, [0.5, 0.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Zeros {
    /// N.
    pub channels: usize,
    /// How many frames.
    pub frames: usize,
}

impl Input for Zeros {
    fn channels(&self) -> usize {
        self.channels
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn load<T: Sample>(&self, _: Isa, _: usize, samples: &mut [T]) {
        samples.fill(T::default());
    }
}

/// Samples on their way between types; stays in the first-level cache.
const SCRATCH: usize = 1024;

/// The same numbers in another type.
fn convert<S: Sample, T: Sample>(from: &[S], to: &mut [T]) {
    if let Some(same) = same(from) {
        to.copy_from_slice(same);
        return;
    }
    for (slot, value) in to.iter_mut().zip(from) {
        *slot = T::from_f64(value.to_f64());
    }
}

/// Frames of f32 from rows, a row for each of N <= 128 channels: `row(i, k, samples)` copies samples of
/// channel i from frame k on.
fn interleave_rows(isa: Isa, n: usize, samples: &mut [f32], row: impl Fn(usize, usize, &mut [f32])) {
    let frames = samples.len() / n;
    let mut rows = [0f32; SCRATCH];
    let step = SCRATCH / n / 8 * 8;
    for start in (0..frames).step_by(step) {
        let count = step.min(frames - start);
        for (i, slots) in rows.chunks_exact_mut(step).take(n).enumerate() {
            row(i, start, &mut slots[..count]);
        }
        let out = &mut samples[start * n..(start + count) * n];
        for k in crate::simd::interleave(isa, &rows, step, n, count, out)..count {
            (0..n).for_each(|i| out[k * n + i] = rows[i * step + k]);
        }
    }
}

/// Most channels that [`interleave_rows`] takes: 8 samples of each fit its rows.
const MOST_ROWS: usize = SCRATCH / 8;

/// The frames of a range of another input, where they lie.
#[derive(Debug, Clone)]
pub struct Frames<'a, I: ?Sized> {
    input: &'a I,
    range: Range<usize>,
}

impl<'a, I: Input + ?Sized> Frames<'a, I> {
    /// Frames `range` of `input`, as far as it has them.
    pub fn new(input: &'a I, range: Range<usize>) -> Self {
        let end = range.end.min(input.frames());
        Self { input, range: range.start.min(end)..end }
    }
}

impl<I: Input + ?Sized> Input for Frames<'_, I> {
    fn channels(&self) -> usize {
        self.input.channels()
    }

    fn frames(&self) -> usize {
        self.range.len()
    }

    fn in_memory<T: Sample>(&self) -> Option<&[T]> {
        let n = self.channels();
        self.input.in_memory().map(|samples| &samples[self.range.start * n..self.range.end * n])
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.input.is_finite(self.range.start + frames.start..self.range.start + frames.end)
    }

    fn load<T: Sample>(&self, isa: Isa, first: usize, samples: &mut [T]) {
        self.input.load(isa, self.range.start + first, samples);
    }
}
