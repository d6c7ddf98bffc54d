//! Recordings as they lie in files and pipes.

use super::{FrameSink, FrameSource, Halves, SplitOutput};
use crate::pcm::peak;
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

    fn store_as<T: Sample>(&mut self, isa: Isa, first: usize, samples: &[T]) {
        self.encoded_peak = self.encoded_peak.max(peak(samples));
        let (SampleLayout { format, container }, before) = self.selected();
        let out = &mut self.bytes[before + first * container..];
        self.clipped += match container == format.bytes() {
            true => encode(isa, format, samples, out),
            false => {
                let slots = out.chunks_mut(container).zip(samples.chunks(1));
                slots.map(|(slot, sample)| encode(isa, format, sample, slot)).sum()
            }
        };
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

    fn in_memory_f32(&self) -> Option<&[f32]> {
        native(self)
    }

    fn in_memory_f64(&self) -> Option<&[f64]> {
        native(self)
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.range(frames).is_finite()
    }

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        load(self, isa, first, samples);
    }

    fn load_f64(&self, isa: Isa, first: usize, samples: &mut [f64]) {
        load(self, isa, first, samples);
    }
}

/// The samples as they lie in memory, if they are numbers of type `T`.
fn native<'a, T: Sample>(frames: &PcmFrames<'a>) -> Option<&'a [T]> {
    let whole = frames.bytes.len() / frames.frame_bytes() * frames.frame_bytes();
    is_native::<T>(frames.layout).then(|| bytemuck::try_cast_slice(&frames.bytes[..whole]).ok()).flatten()
}

fn load<T: Sample>(frames: &PcmFrames<'_>, isa: Isa, first: usize, samples: &mut [T]) {
    let SampleLayout { format, container } = frames.layout;
    let bytes = &frames.bytes[first * frames.frame_bytes()..];
    if frames.layout.is_packed() {
        return decode(isa, format, bytes, samples);
    }
    for (frame, bytes) in samples.chunks_exact_mut(frames.channels).zip(bytes.chunks(frames.frame_bytes())) {
        for (i, slot) in frame.iter_mut().enumerate() {
            // The last sample may end before its container does.
            decode(isa, format, &bytes[i * container..][..format.bytes()], std::slice::from_mut(slot));
        }
    }
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
        self.store_as(isa, first, samples);
    }

    fn store_f64(&mut self, isa: Isa, first: usize, samples: &[f64]) {
        self.store_as(isa, first, samples);
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
