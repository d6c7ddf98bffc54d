//! Samples of a call, wherever and however they lie, to and from planar rows.

use super::sample::Sample;
use crate::io::PcmFormat;
use crate::io::wav::SampleLayout;

/// Samples of N channels in memory, as bytes.
#[derive(Debug, Clone, Copy)]
pub enum PcmTicks<'a> {
    /// Frames of `channels` samples.
    Interleaved {
        /// How a frame lies in memory.
        layout: SampleLayout,
        /// Samples a frame.
        channels: usize,
        /// Whole frames.
        bytes: &'a [u8],
    },
    /// One slice a channel, all with the same number of samples.
    Planar(&'a [PcmChannel<'a>]),
}

/// One channel's samples.
#[derive(Debug, Clone, Copy)]
pub struct PcmChannel<'a> {
    /// How the samples lie in memory.
    pub layout: SampleLayout,
    /// Whole samples.
    pub bytes: &'a [u8],
}

impl PcmTicks<'_> {
    /// N.
    pub fn channels(&self) -> usize {
        match self {
            Self::Interleaved { channels, .. } => *channels,
            Self::Planar(rows) => rows.len(),
        }
    }

    /// Whole ticks.
    pub fn ticks(&self) -> usize {
        match self {
            Self::Interleaved { layout, channels, bytes } => bytes.len() / (layout.container * channels).max(1),
            Self::Planar(rows) => {
                rows.iter().map(|row| row.bytes.len() / row.layout.container.max(1)).min().unwrap_or(0)
            }
        }
    }
}

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

/// Fills planar rows.
pub(crate) trait TickSource {
    fn channels(&self) -> usize;
    fn ticks(&self) -> usize;
    /// `row[k]` = sample of `channel` in tick `first + k`; returns how many were not finite and are
    /// zero now.
    fn gather<T: Sample>(&self, channel: usize, first: usize, row: &mut [T]) -> u64;
}

/// Takes planar rows.
pub(crate) trait FastSink {
    /// Samples that fit.
    fn capacity(&self) -> usize;
    /// Stores phase p of tick `first + k` from `rows[p * stride + k]`, for M phases.
    fn scatter<T: Sample>(&mut self, first: usize, ticks: usize, phases: usize, rows: &[T], stride: usize);
}

/// Numbers in memory, frames of N.
pub(crate) struct Interleaved<'a, S> {
    pub(crate) samples: &'a [S],
    pub(crate) channels: usize,
}

impl<S: Sample> TickSource for Interleaved<'_, S> {
    fn channels(&self) -> usize {
        self.channels
    }

    fn ticks(&self) -> usize {
        self.samples.len() / self.channels
    }

    fn gather<T: Sample>(&self, channel: usize, first: usize, row: &mut [T]) -> u64 {
        let samples = self.samples[first * self.channels + channel..].iter().step_by(self.channels);
        for (slot, &sample) in row.iter_mut().zip(samples) {
            *slot = T::from_f64(sample.to_f64());
        }
        0
    }
}

impl<S: Sample> FastSink for [S] {
    fn capacity(&self) -> usize {
        self.len()
    }

    fn scatter<T: Sample>(&mut self, first: usize, ticks: usize, phases: usize, rows: &[T], stride: usize) {
        let out = &mut self[first * phases..(first + ticks) * phases];
        for (p, row) in rows.chunks(stride).take(phases).enumerate() {
            for (slot, &value) in out[p..].iter_mut().step_by(phases).zip(row) {
                *slot = S::from_f64(value.to_f64());
            }
        }
    }
}

/// Calls `$body` with the format as a constant, so that each becomes a loop of its own.
macro_rules! for_format {
    ($format:expr, $constant:ident => $body:expr) => {
        for_format!(@ $format, $constant => $body;
            S8 U8 S16Le S16Be S24Le S24Be S32Le S32Be F32Le F32Be F64Le F64Be)
    };
    (@ $format:expr, $constant:ident => $body:expr; $($name:ident)*) => {
        match $format {
            $(PcmFormat::$name => { const $constant: PcmFormat = PcmFormat::$name; $body })*
        }
    };
}

impl TickSource for PcmTicks<'_> {
    fn channels(&self) -> usize {
        PcmTicks::channels(self)
    }

    fn ticks(&self) -> usize {
        PcmTicks::ticks(self)
    }

    fn gather<T: Sample>(&self, channel: usize, first: usize, row: &mut [T]) -> u64 {
        let (layout, step, bytes) = match self {
            Self::Interleaved { layout, channels, bytes } => {
                let step = layout.container * channels;
                (*layout, step, &bytes[first * step + channel * layout.container..])
            }
            Self::Planar(rows) => {
                let PcmChannel { layout, bytes } = rows[channel];
                (layout, layout.container, &bytes[first * layout.container..])
            }
        };
        for_format!(layout.format, FORMAT => {
            for (slot, sample) in row.iter_mut().zip(bytes.chunks(step)) {
                *slot = T::from_f64(FORMAT.decode(sample));
            }
        });
        if layout.format.is_float() { replace_not_finite(row) } else { 0 }
    }
}

/// Zeros in place of NaN and infinity, counted.
fn replace_not_finite<T: Sample>(row: &mut [T]) -> u64 {
    let mut count = 0;
    for slot in row {
        if !slot.finite() {
            *slot = T::default();
            count += 1;
        }
    }
    count
}

impl FastSink for PcmOutput<'_> {
    fn capacity(&self) -> usize {
        self.bytes.len() / self.format.bytes()
    }

    fn scatter<T: Sample>(&mut self, first: usize, ticks: usize, phases: usize, rows: &[T], stride: usize) {
        let size = self.format.bytes();
        let out = &mut self.bytes[first * phases * size..(first + ticks) * phases * size];
        let mut clipped = 0;
        for_format!(self.format, FORMAT => {
            for (p, row) in rows.chunks(stride).take(phases).enumerate() {
                let slots = out[p * FORMAT.bytes()..].chunks_mut(FORMAT.bytes() * phases);
                for (slot, &value) in slots.zip(row) {
                    clipped += u64::from(FORMAT.encode(value.to_f64(), slot));
                }
            }
        });
        self.clipped += clipped;
    }
}
