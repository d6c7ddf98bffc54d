//! Samples of a call, wherever and however they lie, to and from planar rows.

use super::sample::Sample;
use crate::io::{PcmFormat, PcmFrames};

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
    /// `rows[i * stride + k]` = sample of channel i in tick `first + k`, for `ticks` ticks; returns
    /// how many were not finite and are zero now.
    fn gather<T: Sample>(&self, first: usize, ticks: usize, rows: &mut [T], stride: usize) -> u64;
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

    fn gather<T: Sample>(&self, first: usize, ticks: usize, rows: &mut [T], stride: usize) -> u64 {
        let samples = &self.samples[first * self.channels..];
        for (i, row) in rows.chunks_mut(stride).take(self.channels).enumerate() {
            for (slot, &sample) in row[..ticks].iter_mut().zip(samples[i..].iter().step_by(self.channels)) {
                *slot = T::from_f64(sample.to_f64());
            }
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

/// Several recordings side by side: their channels follow each other.
impl TickSource for [PcmFrames<'_>] {
    fn channels(&self) -> usize {
        self.iter().map(|part| part.channels).sum()
    }

    fn ticks(&self) -> usize {
        self.iter().map(PcmFrames::frames).min().unwrap_or(0)
    }

    fn gather<T: Sample>(&self, first: usize, ticks: usize, rows: &mut [T], stride: usize) -> u64 {
        let mut replaced = 0;
        let mut rows = rows.chunks_mut(stride);
        for part in self {
            for (i, row) in rows.by_ref().take(part.channels).enumerate() {
                replaced += gather_channel(part, i, first, &mut row[..ticks]);
            }
        }
        replaced
    }
}

fn gather_channel<T: Sample>(part: &PcmFrames<'_>, channel: usize, first: usize, row: &mut [T]) -> u64 {
    let step = part.frame_bytes();
    let bytes = &part.bytes[first * step + channel * part.layout.container..];
    for_format!(part.layout.format, FORMAT => {
        for (slot, sample) in row.iter_mut().zip(bytes.chunks(step)) {
            *slot = T::from_f64(FORMAT.decode(sample));
        }
    });
    if part.layout.format.is_float() { replace_not_finite(row) } else { 0 }
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
