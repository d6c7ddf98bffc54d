//! What recordings say besides their samples, and what of it holds for the output.
//!
//! Frame k of the time axis gives the output samples kM + shift to kM + shift + M - 1, where the shift is
//! the latency that is not dropped. Positions in the inputs are carried over by this rule, with lost frames
//! counted.

use super::capture::InputNotes;
use super::sigmf::{SigmfAnnotation, SigmfCapture};
use super::wav::WavChunk;
use serde_json::{Map, Value, json};
use std::collections::HashSet;

/// Members of `global` that hold for the input's own files only.
const OF_THE_FILE: [&str; 4] =
    ["core:sha512", "core:trailing_bytes", "core:metadata_only", "core:collection"];

/// A chunk with its count of samples since midnight at the output's rate; the output begins earlier by its
/// shift.
fn moved(chunk: &WavChunk, placement: Placement) -> WavChunk {
    let mut chunk = chunk.clone();
    if let Some(count) = chunk.time_reference() {
        let samples = count.saturating_mul(placement.ratio) / placement.per_frame.max(1);
        let samples = samples.saturating_sub(placement.shift);
        chunk.bytes[WavChunk::TIME_REFERENCE].copy_from_slice(&samples.to_le_bytes());
    }
    chunk
}

/// Where the frames of the inputs are in the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placement {
    /// M, output samples per frame.
    pub ratio: u64,
    /// Samples of the input per frame.
    pub per_frame: u64,
    /// Output samples before those of frame 0.
    pub shift: u64,
    /// Output samples in all.
    pub samples: u64,
}

/// What accompanies the samples of an output.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct OutputNotes {
    /// Further members of the `global` object of a SigMF recording.
    pub global: Map<String, Value>,
    /// Its captures; without any, one that begins at 0.
    pub captures: Vec<SigmfCapture>,
    /// Its annotations.
    pub annotations: Vec<SigmfAnnotation>,
    /// Chunks of a WAV file.
    pub chunks: Vec<WavChunk>,
}

impl OutputNotes {
    /// Of the notes of all inputs, whose time begins at number `origin` of the converters. The members of
    /// `global`, the captures and the chunks are those of the first input that has any; annotations are
    /// those of all, each once.
    pub(super) fn of(inputs: &[&InputNotes], origin: u64, placement: Placement) -> Self {
        let (mut notes, mut known) = (Self::default(), HashSet::new());
        for input in inputs {
            let per_frame = input.per_frame.max(1) as u64;
            let (origin, placement) =
                (origin.saturating_mul(per_frame), Placement { per_frame, ..placement });
            if notes.chunks.is_empty() {
                notes.chunks = input.chunks.iter().map(|chunk| moved(chunk, placement)).collect();
            }
            let Some(meta) = &input.sigmf else { continue };
            let axis = Axis { input, offset: meta.global.offset, origin, placement };
            if notes.captures.is_empty() {
                let kept = meta.global.other.iter().filter(|(key, value)| match key.as_str() {
                    "core:extensions" => value.is_array(),
                    key => !OF_THE_FILE.contains(&key),
                });
                notes.global = kept.map(|(key, value)| (key.clone(), value.clone())).collect();
                notes.captures = axis.captures(&meta.captures);
            }
            for annotation in meta.annotations.iter().filter_map(|annotation| axis.annotation(annotation)) {
                if known.insert(json!(annotation).to_string()) {
                    notes.annotations.push(annotation);
                }
            }
        }
        notes
    }

    /// Records the digest of the bank, in a namespace of its own.
    pub fn record_bank(&mut self, digest: &str) {
        self.global.insert("hybank:bank_digest".into(), digest.into());
        let own = json!({ "name": "hybank", "version": env!("CARGO_PKG_VERSION"), "optional": true });
        let extensions = self.global.entry("core:extensions").or_insert_with(|| json!([]));
        if let Value::Array(list) = extensions {
            list.retain(|extension| extension["name"] != "hybank");
            list.push(own);
        }
    }

    /// Adds an annotation about `frames` samples of the input from `first` on, which are its frames unless
    /// it has several per frame.
    pub fn annotate(&mut self, placement: Placement, first: u64, frames: u64, label: &str, comment: &str) {
        let place = |sample: u64| sample.saturating_mul(placement.ratio) / placement.per_frame.max(1);
        let begin = place(first).saturating_add(placement.shift);
        let end = place(first.saturating_add(frames)).saturating_add(placement.shift).min(placement.samples);
        if begin < end {
            let other = [("core:label", label), ("core:comment", comment), ("core:generator", "hybank")];
            let other = other.into_iter().map(|(key, text)| (key.to_owned(), text.into())).collect();
            self.annotations.push(SigmfAnnotation {
                sample_start: begin,
                sample_count: Some(end - begin),
                other,
            });
        }
    }
}

/// The samples of an input in the output.
struct Axis<'a> {
    input: &'a InputNotes,
    /// Number of the file's first sample.
    offset: u64,
    origin: u64,
    placement: Placement,
}

impl Axis<'_> {
    /// The output sample of an input sample, unless it is before the file.
    fn place(&self, sample: u64) -> Option<u64> {
        let frame = sample.checked_sub(self.offset)? / self.input.samples_per_frame as u64;
        let time = self.input.timestamps.time_of(frame, self.origin);
        (time.checked_mul(self.placement.ratio)? / self.placement.per_frame).checked_add(self.placement.shift)
    }

    /// Captures that say more than where they begin; the first begins at 0.
    fn captures(&self, captures: &[SigmfCapture]) -> Vec<SigmfCapture> {
        let placed = captures.iter().filter_map(|capture| {
            let sample_start = self.place(capture.sample_start).filter(|&n| n < self.placement.samples)?;
            Some(SigmfCapture { sample_start, other: capture.other.clone(), ..SigmfCapture::default() })
        });
        let mut placed: Vec<_> = placed.filter(|capture| !capture.other.is_empty()).collect();
        if placed.first().is_none_or(|first| first.sample_start > 0) {
            // What holds from the beginning, but not the time of another sample.
            let mut other = placed.first().map(|first| first.other.clone()).unwrap_or_default();
            other.remove("core:datetime");
            placed.insert(0, SigmfCapture { other, ..SigmfCapture::default() });
        }
        placed
    }

    /// An annotation of samples that are in the output.
    fn annotation(&self, annotation: &Value) -> Option<SigmfAnnotation> {
        let SigmfAnnotation { sample_start, sample_count, other } =
            serde_json::from_value(annotation.clone()).ok()?;
        let begin = self.place(sample_start).filter(|&n| n < self.placement.samples)?;
        let end = sample_count.and_then(|count| self.place(sample_start.checked_add(count)?));
        let count = end.map(|end| end.min(self.placement.samples).saturating_sub(begin));
        Some(SigmfAnnotation { sample_start: begin, sample_count: count, other })
    }
}
