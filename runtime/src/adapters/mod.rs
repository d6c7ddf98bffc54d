//! Samples of a call, wherever and however they lie: to and from interleaved frames of the kernels' number
//! type.
//!
//! A stream takes any [`FrameSource`] and gives to any [`FrameSink`]; those here are [`Interleaved`] and
//! [`Planar`] samples in memory, recordings as they lie in files ([`PcmFrames`](crate::PcmFrames)), several
//! inputs [`SideBySide`], [`Zeros`], slices of samples and [`PcmOutput`](crate::PcmOutput). The kernels'
//! blocks are converted one by one, so that no adapter needs memory of its own.

mod corrections;
mod in_memory;
mod nonlinearity;
mod pcm;
mod side_by_side;

pub(crate) use corrections::{Corrected, Corrections};
pub use in_memory::{Interleaved, Planar};
pub use nonlinearity::Nonlinearity;
pub use pcm::PcmOutput;
pub use side_by_side::SideBySide;

use crate::sample::{same, same_mut};
use crate::{Isa, Sample};
use std::ops::Range;

/// The input of a call: frames of N samples, one of each channel. The kernels ask for it block by block.
pub trait FrameSource: Sync {
    /// N, samples per frame.
    fn channels(&self) -> usize;

    /// Frames of the call.
    fn frames(&self) -> usize;

    /// All samples, frame after frame, if they lie so in memory as f32. The kernels read them there.
    fn in_memory_f32(&self) -> Option<&[f32]> {
        None
    }

    /// As [`FrameSource::in_memory_f32`].
    fn in_memory_f64(&self) -> Option<&[f64]> {
        None
    }

    /// True if no sample of some frames is NaN or infinite; false where that is not looked at.
    fn is_finite(&self, _frames: Range<usize>) -> bool {
        false
    }

    /// Copies frames from frame `first` on to `samples`, frame after frame: `samples.len() / N` frames, all
    /// of which are there. NaN and infinity are copied as they are. `isa` is the instruction set for
    /// conversions.
    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]);

    /// As [`FrameSource::load_f32`].
    fn load_f64(&self, isa: Isa, first: usize, samples: &mut [f64]);
}

/// Where the output of a call goes: samples at the fast rate, M for each frame of the input.
pub trait FrameSink: Send {
    /// Samples that fit.
    fn capacity(&self) -> usize;

    /// From now on the real (0) or the imaginary (1) parts of complex samples are stored. An output for real
    /// samples has part 0 only.
    fn select(&mut self, _part: usize) {}

    /// Room for the samples of a range, if samples lie one after another in memory as f32. The kernels write
    /// them there; some may be written more than once.
    fn slots_f32(&mut self, _samples: Range<usize>) -> Option<&mut [f32]> {
        None
    }

    /// As [`FrameSink::slots_f32`].
    fn slots_f64(&mut self, _samples: Range<usize>) -> Option<&mut [f64]> {
        None
    }

    /// Stores samples from sample `first` on. `isa` is the instruction set for conversions.
    fn store_f32(&mut self, isa: Isa, first: usize, samples: &[f32]);

    /// As [`FrameSink::store_f32`].
    fn store_f64(&mut self, isa: Isa, first: usize, samples: &[f64]);
}

/// An output whose beginning and end may be written by two threads.
pub trait SplitOutput: FrameSink {
    /// Calls `with` with the room for the first `samples` samples and that for all others.
    fn halves(&mut self, samples: usize, with: Halves<'_>);
}

/// Takes both parts of an output.
pub type Halves<'w> = &'w mut dyn FnMut(&mut dyn SplitOutput, &mut dyn SplitOutput);

/// By number type.
impl dyn FrameSource + '_ {
    pub(crate) fn in_memory<T: Sample>(&self) -> Option<&[T]> {
        self.in_memory_f32().and_then(same).or_else(|| self.in_memory_f64().and_then(same))
    }

    /// [`FrameSource::load_f32`] or [`FrameSource::load_f64`].
    pub fn load<T: Sample>(&self, isa: Isa, first: usize, samples: &mut [T]) {
        if let Some(samples) = same_mut(samples) {
            return self.load_f32(isa, first, samples);
        }
        if let Some(samples) = same_mut(samples) {
            self.load_f64(isa, first, samples);
        }
    }
}

/// By number type.
impl dyn FrameSink + '_ {
    pub(crate) fn slots<T: Sample>(&mut self, samples: Range<usize>) -> Option<&mut [T]> {
        if size_of::<T>() == 4 {
            self.slots_f32(samples).and_then(same_mut)
        } else {
            self.slots_f64(samples).and_then(same_mut)
        }
    }

    /// [`FrameSink::store_f32`] or [`FrameSink::store_f64`].
    pub fn store<T: Sample>(&mut self, isa: Isa, first: usize, samples: &[T]) {
        if let Some(samples) = same(samples) {
            self.store_f32(isa, first, samples);
        } else if let Some(samples) = same(samples) {
            self.store_f64(isa, first, samples);
        }
    }
}

/// Frames of zeros.
///
/// ```
/// use hybank_runtime::{Options, Plan, Stream, Zeros};
/// // The sample of the frame before.
/// let mut stream = Stream::new(&Plan::from_taps(&[vec![0.0, 1.0]], 1, 0, Options::default())?);
/// let mut output = [1.0f32; 2];
/// stream.process(&[0.5f32], &mut output[..1])?;
/// stream.run(&Zeros { channels: 1, frames: 2 }, &mut output.as_mut_slice())?;
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

impl FrameSource for Zeros {
    fn channels(&self) -> usize {
        self.channels
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn load_f32(&self, _: Isa, _: usize, samples: &mut [f32]) {
        samples.fill(0.0);
    }

    fn load_f64(&self, _: Isa, _: usize, samples: &mut [f64]) {
        samples.fill(0.0);
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

/// The frames of a range of another input, where they lie.
#[derive(Clone)]
pub struct Frames<'a> {
    input: &'a dyn FrameSource,
    range: Range<usize>,
}

impl<'a> Frames<'a> {
    /// Frames `range` of `input`, as far as it has them.
    pub fn new(input: &'a dyn FrameSource, range: Range<usize>) -> Self {
        let end = range.end.min(input.frames());
        Self { input, range: range.start.min(end)..end }
    }

    /// The places of the frames among the samples of the input.
    fn samples(&self) -> Range<usize> {
        let n = self.channels();
        self.range.start * n..self.range.end * n
    }
}

impl FrameSource for Frames<'_> {
    fn channels(&self) -> usize {
        self.input.channels()
    }

    fn frames(&self) -> usize {
        self.range.len()
    }

    fn in_memory_f32(&self) -> Option<&[f32]> {
        self.input.in_memory_f32().map(|samples| &samples[self.samples()])
    }

    fn in_memory_f64(&self) -> Option<&[f64]> {
        self.input.in_memory_f64().map(|samples| &samples[self.samples()])
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.input.is_finite(self.range.start + frames.start..self.range.start + frames.end)
    }

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        self.input.load_f32(isa, self.range.start + first, samples);
    }

    fn load_f64(&self, isa: Isa, first: usize, samples: &mut [f64]) {
        self.input.load_f64(isa, self.range.start + first, samples);
    }
}
