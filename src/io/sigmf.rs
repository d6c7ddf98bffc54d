//! SigMF recordings: a metadata file beside a file of raw samples.
//!
//! Real samples only, one or several interleaved channels. Captures whose `core:global_index` runs
//! ahead of their `core:sample_start` tell of samples that were lost; they come out as NaN, so
//! that the channels stay in step.

use super::{FrameReader, IoError, PcmFormat};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Frames converted at a time where samples are missing.
const BLOCK_FRAMES: usize = 1024;

/// The part of a SigMF metadata file that matters here; other keys are passed over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SigmfMeta {
    /// What holds for the whole recording.
    pub global: SigmfGlobal,
    /// Where samples without a break begin.
    #[serde(default)]
    pub captures: Vec<SigmfCapture>,
    /// Kept empty; other tools want the key.
    #[serde(default, skip_deserializing)]
    pub annotations: [(); 0],
}

/// The `global` object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SigmfGlobal {
    /// For example `rf32_le`.
    #[serde(rename = "core:datatype")]
    pub datatype: String,
    /// Frames a second.
    #[serde(rename = "core:sample_rate", default, skip_serializing_if = "Option::is_none")]
    pub sample_rate: Option<f64>,
    /// Interleaved channels.
    #[serde(rename = "core:num_channels", default, skip_serializing_if = "Option::is_none")]
    pub num_channels: Option<usize>,
    /// Name of the sample file, if it is not the metadata's own with the ending sigmf-data.
    #[serde(rename = "core:dataset", default, skip_serializing_if = "Option::is_none")]
    pub dataset: Option<String>,
    /// Version of SigMF.
    #[serde(rename = "core:version", default)]
    pub version: String,
}

/// One of the `captures`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SigmfCapture {
    /// Its first frame in the file.
    #[serde(rename = "core:sample_start")]
    pub sample_start: u64,
    /// Its first frame counted at the converter, where lost ones count too.
    #[serde(rename = "core:global_index", default, skip_serializing_if = "Option::is_none")]
    pub global_index: Option<u64>,
}

/// Samples without a break, or a gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Segment {
    Missing(u64),
    /// Until the next capture, or until the end.
    Frames(Option<u64>),
}

impl SigmfMeta {
    /// One channel of fast samples.
    pub fn for_output(format: PcmFormat, rate: f64) -> Self {
        let datatype = format!("r{}", datatype(format));
        Self {
            global: SigmfGlobal {
                datatype,
                sample_rate: Some(rate),
                num_channels: Some(1),
                dataset: None,
                version: "1.0.0".into(),
            },
            captures: vec![SigmfCapture { sample_start: 0, global_index: None }],
            annotations: [],
        }
    }

    /// Reads a metadata file.
    ///
    /// # Errors
    /// [`IoError::System`] if it cannot be read, [`IoError::Sigmf`] if it is not what it should be.
    pub fn read(path: &Path) -> Result<Self, IoError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(IoError::system(&name, "read it"))?;
        serde_json::from_str(&text).map_err(|error| IoError::Sigmf { file: name, problem: error.to_string() })
    }

    /// The sample format of the data type.
    ///
    /// # Errors
    /// [`IoError::Sigmf`] for complex samples and types that no [`PcmFormat`] covers.
    pub fn format(&self, file: &str) -> Result<PcmFormat, IoError> {
        PcmFormat::ALL
            .into_iter()
            .find(|&format| self.global.datatype.strip_prefix('r') == Some(datatype(format).as_str()))
            .ok_or_else(|| IoError::Sigmf {
                file: file.to_owned(),
                problem: format!(
                    "core:datatype is {}; use real samples: ri8, ru8, ri16_le, ri32_le, rf32_le, rf64_le or their _be forms",
                    self.global.datatype
                ),
            })
    }

    /// The converter's count of the first frame.
    pub(super) fn first_index(&self) -> u64 {
        self.captures.first().and_then(|capture| capture.global_index).unwrap_or(0)
    }

    /// Frames and gaps in their order, counted from `origin`.
    fn segments(&self, file: &str, origin: u64) -> Result<VecDeque<Segment>, IoError> {
        let mut segments = VecDeque::new();
        let (mut in_file, mut in_time) = (0, origin);
        for capture in &self.captures {
            let disorder = || IoError::Sigmf {
                file: file.to_owned(),
                problem: format!(
                    "the capture at core:sample_start {} lies before the end of the one before it; captures must be in order and must not overlap",
                    capture.sample_start
                ),
            };
            let frames = capture.sample_start.checked_sub(in_file).ok_or_else(disorder)?;
            in_time += frames;
            let missing =
                capture.global_index.unwrap_or(in_time).checked_sub(in_time).ok_or_else(disorder)?;
            in_time += missing;
            in_file = capture.sample_start;
            segments.extend((frames > 0).then_some(Segment::Frames(Some(frames))));
            segments.extend((missing > 0).then_some(Segment::Missing(missing)));
        }
        segments.push_back(Segment::Frames(None));
        Ok(segments)
    }
}

/// The data type's name without its leading r.
fn datatype(format: PcmFormat) -> String {
    let name = format.name();
    let (kind, rest) = name.split_at(1);
    let kind = if kind == "s" { "i" } else { kind };
    let (bits, order) = rest.split_at(rest.find(['l', 'b']).unwrap_or(rest.len()));
    if order.is_empty() { format!("{kind}{bits}") } else { format!("{kind}{bits}_{order}") }
}

/// The two files of a recording, given either of them.
pub(super) fn file_pair(path: &Path, meta: Option<&SigmfMeta>) -> (PathBuf, PathBuf) {
    let data = match meta.and_then(|meta| meta.global.dataset.as_ref()) {
        Some(name) => path.with_file_name(name),
        None => path.with_extension("sigmf-data"),
    };
    (path.with_extension("sigmf-meta"), data)
}

/// True for the names of SigMF's two files.
pub(super) fn is_sigmf(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "sigmf-meta" || extension == "sigmf-data")
}

/// The samples as f64le bytes, with NaN for each one that was lost.
#[derive(Debug)]
pub(super) struct Timeline<R> {
    frames: FrameReader<R>,
    format: PcmFormat,
    channels: usize,
    segments: VecDeque<Segment>,
    raw: Vec<u8>,
    /// Bytes that are ready, and how many of them were taken.
    ready: Vec<u8>,
    taken: usize,
}

impl<R: Read> Timeline<R> {
    /// `Ok(Err(inner))` gives the source back if nothing is missing.
    pub(super) fn new(
        inner: R,
        meta: &SigmfMeta,
        format: PcmFormat,
        channels: usize,
        file: &str,
        origin: u64,
    ) -> Result<Result<Self, R>, IoError> {
        let segments = meta.segments(file, origin)?;
        if segments.iter().all(|segment| matches!(segment, Segment::Frames(_))) {
            return Ok(Err(inner));
        }
        let frames = FrameReader::new(inner, format.bytes() * channels, None);
        Ok(Ok(Self { frames, format, channels, segments, raw: Vec::new(), ready: Vec::new(), taken: 0 }))
    }

    /// Makes the next frames ready; leaves none at the end.
    fn refill(&mut self) -> io::Result<()> {
        self.ready.clear();
        self.taken = 0;
        while self.ready.is_empty() {
            let Some(segment) = self.segments.pop_front() else { return Ok(()) };
            match segment {
                Segment::Missing(count) => {
                    let frames = count.min(BLOCK_FRAMES as u64);
                    self.put_back(Segment::Missing(count - frames), count > frames);
                    let lost = std::iter::repeat_n(f64::NAN.to_le_bytes(), frames as usize * self.channels);
                    self.ready.extend(lost.flatten());
                }
                Segment::Frames(count) => self.decode(count)?,
            }
        }
        Ok(())
    }

    fn put_back(&mut self, segment: Segment, some_left: bool) {
        if some_left {
            self.segments.push_front(segment);
        }
    }

    fn decode(&mut self, count: Option<u64>) -> io::Result<()> {
        let want = count.map_or(BLOCK_FRAMES, |count| count.min(BLOCK_FRAMES as u64) as usize);
        let size = self.format.bytes();
        self.raw.resize(want * size * self.channels, 0);
        let filled = self.frames.fill(&mut self.raw)?;
        let got = filled / (size * self.channels);
        let left = count.map(|count| count - got as u64);
        // A file that ends before its last capture has no more of anything.
        if got < want {
            self.segments.clear();
        } else {
            self.put_back(Segment::Frames(left), left != Some(0));
        }
        let samples = self.raw[..filled].chunks_exact(size).map(|b| self.format.decode(b).to_le_bytes());
        self.ready.extend(samples.flatten());
        Ok(())
    }
}

impl<R: Read> Read for Timeline<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.ready.len() {
            self.refill()?;
        }
        let count = bytes.len().min(self.ready.len() - self.taken);
        bytes[..count].copy_from_slice(&self.ready[self.taken..self.taken + count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meta(datatype: &str, captures: &[(u64, Option<u64>)]) -> SigmfMeta {
        let captures: Vec<_> = captures
            .iter()
            .map(|&(sample_start, global_index)| SigmfCapture { sample_start, global_index })
            .collect();
        let mut meta = SigmfMeta::for_output(PcmFormat::F32Le, 1.0);
        meta.global.datatype = datatype.into();
        SigmfMeta { captures, ..meta }
    }

    fn read(
        meta: &SigmfMeta,
        samples: std::ops::Range<i16>,
        channels: usize,
        origin: u64,
    ) -> Vec<Option<i16>> {
        let bytes: Vec<u8> = samples.flat_map(i16::to_be_bytes).collect();
        let mut timeline =
            Timeline::new(&bytes[..], meta, PcmFormat::S16Be, channels, "test", origin).unwrap().unwrap();
        let mut out = Vec::new();
        timeline.read_to_end(&mut out).unwrap();
        let value = |b: &[u8]| PcmFormat::F64Le.decode(b);
        out.chunks_exact(8).map(value).map(|x| x.is_finite().then_some((x * 32768.0) as i16)).collect()
    }

    #[test]
    fn every_format_has_a_name_and_back() {
        let names: Vec<String> = PcmFormat::ALL.into_iter().map(|f| format!("r{}", datatype(f))).collect();
        let want = [
            "ri8", "ru8", "ri16_le", "ri16_be", "ri24_le", "ri24_be", "ri32_le", "ri32_be", "rf32_le",
            "rf32_be", "rf64_le", "rf64_be",
        ];
        assert_eq!(names, want);
        for (name, format) in want.into_iter().zip(PcmFormat::ALL) {
            assert_eq!(meta(name, &[]).format("test").unwrap(), format);
        }
        let error = meta("cf32_le", &[]).format("test").unwrap_err().to_string();
        assert!(error.contains("cf32_le") && error.contains("real samples"), "{error}");
    }

    #[test]
    fn lost_samples_come_out_as_nan() {
        let meta = meta("ri16_be", &[(0, Some(100)), (3, Some(105)), (5, Some(3000))]);
        let got = read(&meta, 0..14, 2, 98);
        // Two frames late, two lost after three, then up to 3000.
        let mut want = vec![None; 4];
        want.extend((0..6).map(Some));
        want.extend([None; 4]);
        want.extend((6..10).map(Some));
        want.extend(vec![None; 2 * (3000 - 107)]);
        want.extend((10..14).map(Some));
        assert_eq!(got, want);
    }

    #[test]
    fn captures_without_a_break_change_nothing() {
        for captures in [&[][..], &[(0, None)], &[(0, Some(7)), (4, None), (9, Some(16))]] {
            let meta = meta("ri16_be", captures);
            let whole = Timeline::new(&[1u8, 2][..], &meta, PcmFormat::S16Be, 1, "test", meta.first_index());
            assert_eq!(whole.unwrap().unwrap_err(), [1, 2]);
        }
    }

    #[test]
    fn captures_that_overlap_are_refused() {
        for captures in [&[(0, Some(5)), (4, Some(6))][..], &[(4, None), (2, None)]] {
            let refused =
                Timeline::new(&[][..], &meta("ri8", captures), PcmFormat::S8, 1, "test", 0).unwrap_err();
            assert!(refused.to_string().contains("must not overlap"), "{refused}");
        }
    }
}
