//! Recordings as they lie in files and pipes.

use super::{FrameSink, FrameSource, Halves, SCRATCH, SplitOutput, convert};
use crate::pcm::{for_pcm_format, peak};
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
    /// The largest magnitude of the samples that were encoded.
    encoded_peak: f64,
    /// The part of complex samples that is stored, see [`FrameSink::select`].
    part: Option<usize>,
}

impl<'a> PcmOutput<'a> {
    /// Room for samples that lie close together, none of them clipped so far.
    pub fn packed(format: PcmFormat, bytes: &'a mut [u8]) -> Self {
        Self { layout: SampleLayout::packed(format), bytes, clipped: 0, encoded_peak: 0.0, part: None }
    }

    /// The largest magnitude, of full scale, of the first `samples` numbers, as they were before they
    /// saturated.
    pub fn peak(&self, samples: usize) -> f64 {
        let size = self.layout.format.bytes();
        let written = &self.bytes[..(samples * size).min(self.bytes.len())];
        if is_native::<f32>(self.layout) {
            return bytemuck::try_cast_slice(written).map_or(self.encoded_peak, peak::<f32>);
        }
        if is_native::<f64>(self.layout) {
            return bytemuck::try_cast_slice(written).map_or(self.encoded_peak, peak::<f64>);
        }
        self.encoded_peak
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

impl FrameSource for PcmFrames<'_> {
    fn channels(&self) -> usize {
        self.channels
    }

    fn frames(&self) -> usize {
        self.frames()
    }

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        let done = if self.layout.is_packed() {
            decode(isa, self.layout.format, &self.bytes[first * self.frame_bytes()..], samples)
        } else {
            0
        };
        // Whole frames only; the rest one by one.
        let done = done / self.channels;
        load_each(self, first + done, &mut samples[done * self.channels..]);
    }

    fn load_f64(&self, _: Isa, first: usize, samples: &mut [f64]) {
        load_each(self, first, samples);
    }
}

/// Frame by frame.
fn load_each<T: Sample>(frames: &PcmFrames<'_>, first: usize, samples: &mut [T]) {
    let container = frames.layout.container;
    // The last sample may end before its container does.
    let bytes = frames.bytes.chunks(frames.frame_bytes()).skip(first);
    for_pcm_format!(frames.layout.format, FORMAT => {
        for (frame, bytes) in samples.chunks_exact_mut(frames.channels).zip(bytes) {
            for (i, slot) in frame.iter_mut().enumerate() {
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
        self.encoded_peak = self.encoded_peak.max(peak(samples));
        let (layout, out) = self.from(first);
        self.clipped += match layout.is_packed() {
            true => encode(isa, layout.format, samples, out),
            false => encode_each(layout, samples, out),
        };
    }

    fn store_f64(&mut self, isa: Isa, first: usize, samples: &[f64]) {
        self.encoded_peak = self.encoded_peak.max(peak(samples));
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
        let (layout, part, size) = (self.layout, self.part, self.selected().0.container);
        let (earlier, later) = self.bytes.split_at_mut(samples * size);
        let half = |bytes| PcmOutput { layout, bytes, clipped: 0, encoded_peak: 0.0, part };
        let (mut earlier, mut later) = (half(earlier), half(later));
        with(&mut earlier, &mut later);
        self.clipped += earlier.clipped + later.clipped;
        self.encoded_peak = self.encoded_peak.max(earlier.encoded_peak).max(later.encoded_peak);
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
