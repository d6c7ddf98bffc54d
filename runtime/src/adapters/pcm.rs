//! Recordings as they lie in files and pipes.

use super::{FrameSink, FrameSource, Halves, MOST_ROWS, SCRATCH, SplitOutput, convert, interleave_rows};
use crate::pcm::for_pcm_format;
use crate::simd::{decode, encode};
use crate::{Isa, PcmFormat, PcmFrames, Sample, SampleLayout};
use std::ops::Range;

/// Room for output samples as they lie in files and pipes. Those beyond the full scale of an integer format
/// saturate.
#[derive(Debug)]
pub struct PcmOutput<'a> {
    /// How samples, or the numbers of complex samples, are to be stored; bytes between them stay.
    pub layout: SampleLayout,
    /// M samples per frame.
    pub bytes: &'a mut [u8],
    /// Samples that were clipped, added to by every call.
    pub clipped: u64,
    /// The part of complex samples that is stored, see [`FrameSink::select`].
    part: Option<usize>,
}

impl<'a> PcmOutput<'a> {
    /// Room for samples that lie close together, none of them clipped so far.
    pub fn packed(format: PcmFormat, bytes: &'a mut [u8]) -> Self {
        Self { layout: SampleLayout::packed(format), bytes, clipped: 0, part: None }
    }

    /// Room for the first `samples` samples and for all others, and where what they clip is to be added.
    pub fn split(&mut self, samples: usize) -> ([PcmOutput<'_>; 2], &mut u64) {
        let (layout, part, size) = (self.layout, self.part, self.selected().0.container);
        let (earlier, later) = self.bytes.split_at_mut(samples * size);
        let half = |bytes| PcmOutput { layout, bytes, clipped: 0, part };
        ([half(earlier), half(later)], &mut self.clipped)
    }

    /// Room for samples that lie in memory as numbers do. Parts of complex samples lie apart.
    fn slots_as<T: Sample>(&mut self, samples: Range<usize>) -> Option<&mut [T]> {
        let is_native = is_native::<T>(self.selected().0);
        let numbers = is_native.then(|| bytemuck::try_cast_slice_mut(self.bytes).ok());
        numbers.flatten().map(|numbers| &mut numbers[samples])
    }

    /// How the selected samples lie, and the room from sample `first` on.
    fn from(&mut self, first: usize) -> (SampleLayout, &mut [u8]) {
        let (layout, before) = self.selected();
        (layout, &mut self.bytes[before + first * layout.container..])
    }

    /// How the selected samples lie, and the bytes before the first one.
    fn selected(&self) -> (SampleLayout, usize) {
        self.part.map_or((self.layout, 0), |part| (self.layout.part(), part * self.layout.container))
    }
}

/// Whether samples of a layout lie in memory as numbers of type `T` do.
fn is_native<T: Sample>(layout: SampleLayout) -> bool {
    let format = if size_of::<T>() == 4 { PcmFormat::F32Le } else { PcmFormat::F64Le };
    layout == SampleLayout::packed(format.native())
}

/// Several recordings side by side: their channels follow each other.
impl FrameSource for &[PcmFrames<'_>] {
    fn channels(&self) -> usize {
        self.iter().map(|recording| recording.channels).sum()
    }

    fn frames(&self) -> usize {
        self.iter().map(PcmFrames::frames).min().unwrap_or(0)
    }

    fn in_memory_f32(&self) -> Option<&[f32]> {
        native(self)
    }

    fn in_memory_f64(&self) -> Option<&[f64]> {
        native(self)
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.iter().all(|recording| recording.range(frames.clone()).is_finite())
    }

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        let n = self.channels();
        match self {
            [alone] => load_recording(isa, alone, first, samples),
            many if n <= MOST_ROWS && many.iter().all(|recording| recording.channels == 1) => {
                interleave_rows(isa, n, samples, |i, start, row| {
                    load_recording(isa, &many[i], first + start, row);
                });
            }
            many => load_each(many, first, samples),
        }
    }

    fn load_f64(&self, _: Isa, first: usize, samples: &mut [f64]) {
        load_each(self, first, samples);
    }
}

/// The samples of one recording as they lie in memory, if they are numbers of type `T`.
fn native<'a, T: Sample>(recordings: &[PcmFrames<'a>]) -> Option<&'a [T]> {
    let [alone] = recordings else { return None };
    let whole = alone.bytes.len() / alone.frame_bytes() * alone.frame_bytes();
    is_native::<T>(alone.layout).then(|| bytemuck::try_cast_slice(&alone.bytes[..whole]).ok()).flatten()
}

/// All channels from one recording.
fn load_recording(isa: Isa, recording: &PcmFrames<'_>, first: usize, samples: &mut [f32]) {
    let PcmFrames { layout, channels, bytes } = *recording;
    let done = if layout.is_packed() {
        decode(isa, layout.format, &bytes[first * recording.frame_bytes()..], samples)
    } else {
        0
    };
    // Whole frames only; the rest one by one.
    let done = done / channels;
    load_columns(recording, first + done, channels, &mut samples[done * channels..]);
}

/// Any recordings, sample by sample.
fn load_each<T: Sample>(recordings: &[PcmFrames<'_>], first: usize, samples: &mut [T]) {
    let n = recordings.iter().map(|recording| recording.channels).sum();
    let mut offset = 0;
    for recording in recordings {
        load_columns(recording, first, n, &mut samples[offset..]);
        offset += recording.channels;
    }
}

/// The channels of a recording to the first columns of frames of `n` samples (the last
/// frame may end after them).
fn load_columns<T: Sample>(recording: &PcmFrames<'_>, first: usize, n: usize, samples: &mut [T]) {
    let container = recording.layout.container;
    // The last sample may end before its container does.
    let bytes = recording.bytes.chunks(recording.frame_bytes()).skip(first);
    for_pcm_format!(recording.layout.format, FORMAT => {
        for (frame, bytes) in samples.chunks_mut(n).zip(bytes) {
            for (i, slot) in frame[..recording.channels].iter_mut().enumerate() {
                *slot = T::from_f64(FORMAT.decode(&bytes[i * container..]));
            }
        }
    });
}

impl FrameSink for PcmOutput<'_> {
    fn capacity(&self) -> usize {
        let (layout, before) = self.selected();
        layout.containers(self.bytes.len().saturating_sub(before))
    }

    fn select(&mut self, part: usize) {
        self.part = Some(part);
    }

    fn slots_f32(&mut self, samples: Range<usize>) -> Option<&mut [f32]> {
        self.slots_as(samples)
    }

    fn slots_f64(&mut self, samples: Range<usize>) -> Option<&mut [f64]> {
        self.slots_as(samples)
    }

    fn store_f32(&mut self, isa: Isa, first: usize, samples: &[f32]) {
        let (layout, out) = self.from(first);
        self.clipped += match layout.is_packed() {
            true => encode(isa, layout.format, samples, out),
            false => encode_each(layout, samples, out),
        };
    }

    fn store_f64(&mut self, isa: Isa, first: usize, samples: &[f64]) {
        let (layout, out) = self.from(first);
        self.clipped += match layout.is_packed() && layout.format.bytes() < 4 {
            true => encode_by_scratch(isa, layout.format, samples, out),
            // Formats that hold more digits than f32, and samples apart.
            false => encode_each(layout, samples, out),
        };
    }
}

impl SplitOutput for PcmOutput<'_> {
    fn halves(&mut self, samples: usize, with: Halves<'_>) {
        let ([mut earlier, mut later], clipped) = self.split(samples);
        with(&mut earlier, &mut later);
        *clipped += earlier.clipped + later.clipped;
    }
}

/// Rounded to f32 first, which formats of few digits do not notice.
fn encode_by_scratch(isa: Isa, format: PcmFormat, samples: &[f64], out: &mut [u8]) -> u64 {
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
fn encode_each<T: Sample>(layout: SampleLayout, samples: &[T], out: &mut [u8]) -> u64 {
    let mut clipped = 0;
    for_pcm_format!(layout.format, FORMAT => {
        let mut put = |(slot, value): (&mut [u8], &T)| {
            // As packed ones: formats of few digits are rounded to f32 first.
            let value = if FORMAT.bytes() < 4 { f64::from(value.to_f64() as f32) } else { value.to_f64() };
            clipped += u64::from(FORMAT.encode(value, slot));
        };
        if layout.is_packed() {
            out.chunks_exact_mut(FORMAT.bytes()).zip(samples).for_each(&mut put);
        } else {
            out.chunks_mut(layout.container).zip(samples).for_each(&mut put);
        }
    });
    clipped
}
