//! Samples of a call, wherever and however they lie, to and from planar rows.

use super::rows::{Rows, RowsMut};
use super::sample::Sample;
use super::simd::{Progress, encode};
use crate::io::{PcmFormat, PcmFrames, for_pcm_format};
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

/// Samples on their way through f32 to an integer format; stays in the first-level cache.
const SCRATCH: usize = 1024;

/// Fills planar rows.
pub(crate) trait TickSource {
    fn channels(&self) -> usize;
    fn ticks(&self) -> usize;
    /// Rows from ticks `first..first + ticks`; returns how many samples were not finite and are zero
    /// now.
    fn gather<T: Sample>(&self, first: usize, ticks: usize, rows: RowsMut<'_, T>) -> u64;
}

/// Takes planar rows.
pub(crate) trait FastSink {
    /// Samples that fit.
    fn capacity(&self) -> usize;
    /// Stores ticks `first..first + ticks` from rows.
    fn scatter<T: Sample>(&mut self, first: usize, ticks: usize, rows: Rows<'_, T>);
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

    fn gather<T: Sample>(&self, first: usize, ticks: usize, mut rows: RowsMut<'_, T>) -> u64 {
        let samples = &self.samples[first * self.channels..(first + ticks) * self.channels];
        let part = Part { offset: 0, channels: self.channels };
        let fast = part.fast(&mut rows, ticks, |head, frames, n, rows, stride, isa| {
            T::deinterleave_numbers(isa, &samples[head * part.channels..], n, frames, rows, stride)
        });
        fast.replaced + part.slow(&mut rows, &fast, ticks, |t, i| samples[t * part.channels + i].to_f64())
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

    fn gather<T: Sample>(&self, first: usize, ticks: usize, mut rows: RowsMut<'_, T>) -> u64 {
        let mut replaced = 0;
        let mut offset = 0;
        for frames in self {
            let part = Part { offset, channels: frames.channels };
            replaced += gather_frames(part, frames, first, ticks, &mut rows);
            offset += frames.channels;
        }
        replaced
    }
}

fn gather_frames<T: Sample>(
    part: Part,
    frames: &PcmFrames<'_>,
    first: usize,
    ticks: usize,
    rows: &mut RowsMut<'_, T>,
) -> u64 {
    let size = frames.frame_bytes();
    let container = frames.layout.container;
    let format = frames.layout.format;
    let bytes = &frames.bytes[first * size..(first + ticks) * size];
    let fast = part.fast(rows, ticks, |head, count, n, rows, stride, isa| {
        if container != format.bytes() {
            return Progress::default();
        }
        T::deinterleave_bytes(isa, format, &bytes[head * size..], n, count, rows, stride)
    });
    let slow = for_pcm_format!(format, FORMAT => {
        part.slow(rows, &fast, ticks, |t, i| FORMAT.decode(&bytes[t * size + i * container..]))
    });
    fast.replaced + slow
}

/// The channels of one recording among all N.
#[derive(Debug, Clone, Copy)]
struct Part {
    offset: usize,
    channels: usize,
}

/// What the fast conversion did.
struct Fast {
    ticks: Range<usize>,
    replaced: u64,
}

impl Part {
    /// Whole super-ticks, as far as `convert(first tick, super-ticks, rows, ..)` gets. The rows of a
    /// folded part lie at equal distances only if it has all channels or one.
    fn fast<T: Sample>(
        self,
        rows: &mut RowsMut<'_, T>,
        ticks: usize,
        convert: impl FnOnce(usize, usize, usize, &mut [T], usize, super::Isa) -> Progress,
    ) -> Fast {
        let fold = rows.fold;
        let (head, whole) = fold.whole(ticks);
        let distance = match () {
            () if fold.ticks == 1 || self.channels == rows.channels => rows.stride,
            () if self.channels == 1 => rows.stride * rows.channels,
            () => return Fast { ticks: 0..0, replaced: 0 },
        };
        let column = fold.place(head).1;
        let n = self.channels * fold.ticks;
        let target = &mut rows.samples[self.offset * rows.stride + column..];
        let progress = convert(head, whole, n, target, distance, rows.isa);
        let replaced = if progress.suspect {
            target
                .chunks_mut(distance)
                .take(n)
                .map(|row| replace_not_finite(&mut row[..progress.frames]))
                .sum()
        } else {
            0
        };
        Fast { ticks: head..head + progress.frames * fold.ticks, replaced }
    }

    /// All ticks that the fast conversion left, one by one.
    #[inline(always)]
    fn slow<T: Sample>(
        self,
        rows: &mut RowsMut<'_, T>,
        fast: &Fast,
        ticks: usize,
        sample: impl Fn(usize, usize) -> f64,
    ) -> u64 {
        let mut replaced = 0;
        for i in 0..self.channels {
            for t in (0..fast.ticks.start).chain(fast.ticks.end..ticks) {
                let value = sample(t, i);
                replaced += u64::from(!value.is_finite());
                *rows.slot(self.offset + i, t) = T::from_f64(if value.is_finite() { value } else { 0.0 });
            }
        }
        replaced
    }
}

/// Zeros in place of NaN and infinity, counted.
fn replace_not_finite<T: Sample>(row: &mut [T]) -> u64 {
    let mut count = 0;
    for slot in row.iter_mut().filter(|value| !value.finite()) {
        *slot = T::default();
        count += 1;
    }
    count
}

impl FastSink for [f32] {
    fn capacity(&self) -> usize {
        self.len()
    }

    fn scatter<T: Sample>(&mut self, first: usize, ticks: usize, rows: Rows<'_, T>) {
        let out = &mut self[first * rows.phases..(first + ticks) * rows.phases];
        store_numbers(out, ticks, &rows);
    }
}

impl FastSink for [f64] {
    fn capacity(&self) -> usize {
        self.len()
    }

    fn scatter<T: Sample>(&mut self, first: usize, ticks: usize, rows: Rows<'_, T>) {
        let out = &mut self[first * rows.phases..(first + ticks) * rows.phases];
        for (t, tick) in out.chunks_exact_mut(rows.phases).enumerate().take(ticks) {
            for (p, slot) in tick.iter_mut().enumerate() {
                *slot = rows.get(p, t).to_f64();
            }
        }
    }
}

/// Ticks 0..ticks of the rows as f32.
fn store_numbers<T: Sample>(out: &mut [f32], ticks: usize, rows: &Rows<'_, T>) {
    let m = rows.phases;
    let (head, whole) = rows.fold.whole(ticks);
    let column = rows.fold.place(head).1;
    let done = T::interleave(
        rows.isa,
        &rows.samples[column..],
        rows.stride,
        m * rows.fold.ticks,
        whole,
        &mut out[head * m..],
    );
    let fast = head..head + done * rows.fold.ticks;
    for t in (0..fast.start).chain(fast.end..ticks) {
        for (p, slot) in out[t * m..(t + 1) * m].iter_mut().enumerate() {
            *slot = rows.get(p, t).to_f64() as f32;
        }
    }
}

impl FastSink for PcmOutput<'_> {
    fn capacity(&self) -> usize {
        self.bytes.len() / self.format.bytes()
    }

    fn scatter<T: Sample>(&mut self, first: usize, ticks: usize, rows: Rows<'_, T>) {
        let (m, size) = (rows.phases, self.format.bytes());
        let out = &mut self.bytes[first * m * size..(first + ticks) * m * size];
        let wide = self.format.bytes() == 8 || (T::BYTES == 8 && self.format.bytes() == 4);
        self.clipped += if wide || m > SCRATCH {
            store_each(self.format, out, &rows)
        } else {
            store_by_scratch(self.format, out, ticks, rows)
        };
    }
}

/// Formats that hold more digits than f32 are stored sample by sample.
fn store_each<T: Sample>(format: PcmFormat, out: &mut [u8], rows: &Rows<'_, T>) -> u64 {
    let mut clipped = 0;
    for_pcm_format!(format, FORMAT => {
        for (t, tick) in out.chunks_exact_mut(rows.phases * FORMAT.bytes()).enumerate() {
            for (p, slot) in tick.chunks_exact_mut(FORMAT.bytes()).enumerate() {
                clipped += u64::from(FORMAT.encode(rows.get(p, t).to_f64(), slot));
            }
        }
    });
    clipped
}

/// Interleaved first, then encoded where they lie close together.
fn store_by_scratch<T: Sample>(format: PcmFormat, out: &mut [u8], ticks: usize, rows: Rows<'_, T>) -> u64 {
    let mut scratch = [0f32; SCRATCH];
    let m = rows.phases;
    let step = (SCRATCH / m / rows.fold.ticks * rows.fold.ticks).max(1);
    let mut clipped = 0;
    let mut t = 0;
    while t < ticks {
        let count = step.min(ticks - t);
        let (_, column) = rows.fold.place(t);
        let fold = super::rows::Fold { lead: rows.fold.place(t).0, ..rows.fold };
        let some = Rows { samples: &rows.samples[column..], fold, ..rows };
        store_numbers(&mut scratch[..count * m], count, &some);
        let bytes = &mut out[t * m * format.bytes()..(t + count) * m * format.bytes()];
        clipped += encode(rows.isa, format, &scratch[..count * m], bytes);
        t += count;
    }
    clipped
}
