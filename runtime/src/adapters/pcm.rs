//! Recordings as they lie in files and pipes.

use super::{Input, MOST_ROWS, Output, SCRATCH, SplitOutput, convert, interleave_rows};
use crate::pcm::for_pcm_format;
use crate::sample::{Samples, SamplesMut};
use crate::simd::{decode, encode};
use crate::{Isa, PcmFormat, PcmFrames, Sample, SampleLayout};

/// Room for output samples as they lie in files and pipes. Those beyond the full scale of an integer format
/// saturate.
#[derive(Debug)]
pub struct PcmOutput<'a> {
    /// How samples are to be stored; bytes between samples stay as they are.
    pub layout: SampleLayout,
    /// M samples per frame.
    pub bytes: &'a mut [u8],
    /// Samples that were clipped, added to by every call.
    pub clipped: u64,
}

impl<'a> PcmOutput<'a> {
    /// Room for samples that lie close together, none of them clipped so far.
    pub fn packed(format: PcmFormat, bytes: &'a mut [u8]) -> Self {
        Self { layout: SampleLayout::packed(format), bytes, clipped: 0 }
    }

    /// Room for one part of complex samples, which are pairs of those of this output: the real parts if
    /// `part` is 0, the imaginary ones if it is 1. What is clipped is counted apart.
    pub fn part(&mut self, part: usize) -> PcmOutput<'_> {
        let start = (part * self.layout.container).min(self.bytes.len());
        PcmOutput { layout: self.layout.part(), bytes: &mut self.bytes[start..], clipped: 0 }
    }
}

/// Several recordings side by side: their channels follow each other.
impl Input for [PcmFrames<'_>] {
    fn channels(&self) -> usize {
        self.iter().map(|recording| recording.channels).sum()
    }

    fn frames(&self) -> usize {
        self.iter().map(PcmFrames::frames).min().unwrap_or(0)
    }

    fn load<T: Sample>(&self, isa: Isa, first: usize, samples: &mut [T]) {
        if let [alone] = self {
            return load_recording(isa, alone, first, samples);
        }
        let n = self.channels();
        let mono = self.iter().all(|recording| recording.channels == 1);
        match T::typed_mut(samples) {
            SamplesMut::F32(samples) if mono && n <= MOST_ROWS => {
                interleave_rows(isa, n, samples, |i, start, row| {
                    load_recording(isa, &self[i], first + start, row);
                });
            }
            _ => load_each(self, first, samples),
        }
    }
}

/// All channels from one recording.
fn load_recording<T: Sample>(isa: Isa, recording: &PcmFrames<'_>, first: usize, samples: &mut [T]) {
    let done = match T::typed_mut(samples) {
        SamplesMut::F32(samples) if recording.layout.is_packed() => {
            decode(isa, recording.layout.format, &recording.bytes[first * recording.frame_bytes()..], samples)
        }
        _ => 0,
    };
    // Whole frames only; the rest one by one.
    let done = done / recording.channels;
    load_columns(recording, first + done, recording.channels, &mut samples[done * recording.channels..]);
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

impl Output for PcmOutput<'_> {
    fn capacity(&self) -> usize {
        self.layout.containers(self.bytes.len())
    }

    fn store<T: Sample>(&mut self, isa: Isa, first: usize, samples: &[T]) {
        let SampleLayout { format, container } = self.layout;
        let out = &mut self.bytes[first * container..];
        self.clipped += match T::typed(samples) {
            Samples::F32(samples) if self.layout.is_packed() => encode(isa, format, samples, out),
            Samples::F64(samples) if self.layout.is_packed() && format.bytes() < 4 => {
                encode_by_scratch(isa, format, samples, out)
            }
            // Formats that hold more digits than f32, and samples apart.
            _ => encode_each(self.layout, samples, out),
        };
    }
}

impl SplitOutput for PcmOutput<'_> {
    type Half<'h>
        = PcmOutput<'h>
    where
        Self: 'h;

    fn halves<'h, R>(
        &'h mut self,
        samples: usize,
        with: impl FnOnce(&mut Self::Half<'h>, &mut Self::Half<'h>) -> R,
    ) -> R {
        let Self { layout, bytes, clipped } = self;
        let (earlier, later) = bytes.split_at_mut(samples * layout.container);
        let half = |bytes| PcmOutput { layout: *layout, bytes, clipped: 0 };
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
fn encode_each<T: Sample>(layout: SampleLayout, samples: &[T], out: &mut [u8]) -> u64 {
    let mut clipped = 0;
    for_pcm_format!(layout.format, FORMAT => {
        let mut put = |(slot, value): (&mut [u8], &T)| clipped += u64::from(FORMAT.encode(value.to_f64(), slot));
        if layout.is_packed() {
            out.chunks_exact_mut(FORMAT.bytes()).zip(samples).for_each(&mut put);
        } else {
            out.chunks_mut(layout.container).zip(samples).for_each(&mut put);
        }
    });
    clipped
}
