//! The metadata file of SigMF recordings, which accompanies a file of raw samples.
//!
//! Real or complex samples, one or several interleaved channels. If `core:global_index` increases by more
//! than `core:sample_start` between captures, samples were lost.

use super::stream_header::MOST_CHANNELS;
use super::timestamps::{Timestamp, Timestamps};
use super::{IoError, PcmFormat, SampleLayout, StreamHeader};
use crate::files::{Bound, read_text};
use crate::messages::{Number, Quoted, of_json};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::path::{Component, Path, PathBuf};

/// Maximum size of a metadata file.
pub(super) const META_FILE: Bound = Bound {
    bytes: 64 << 20,
    kind: "a SigMF metadata file",
    remedy: "give the file that was meant, or remove annotations from it",
};

/// A SigMF metadata file. Keys that are not supported are kept.
///
/// ```
/// use hybank_core::io::{PcmFormat, SigmfMeta};
/// let text = r#"{"global": {"core:datatype": "ci16_le", "core:sample_rate": 2e6, "core:hw": "two mixers"},
///     "captures": [{"core:sample_start": 0}, {"core:sample_start": 50, "core:global_index": 58}]}"#;
/// let meta = SigmfMeta::parse(text, "radio.sigmf-meta")?;
/// assert_eq!((meta.format("radio.sigmf-meta")?, meta.is_complex()), (PcmFormat::S16Le, true));
/// assert_eq!(meta.global.other["core:hw"], "two mixers");
/// // Eight frames were lost before the second capture.
/// assert_eq!(meta.captures[1].global_index, Some(meta.captures[1].sample_start + 8));
/// # Ok::<(), hybank_core::io::IoError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SigmfMeta {
    /// Properties of the whole recording.
    pub global: SigmfGlobal,
    /// The starts of runs of consecutive samples.
    #[serde(default)]
    pub captures: Vec<SigmfCapture>,
    /// What is said of some of the samples, as it was written: [`SigmfAnnotation`]s if it is well-formed.
    #[serde(default)]
    pub annotations: Vec<Value>,
}

/// The `global` object.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SigmfGlobal {
    /// For example `rf32_le`.
    #[serde(rename = "core:datatype")]
    pub datatype: String,
    /// Frames per second.
    #[serde(rename = "core:sample_rate", default, skip_serializing_if = "Option::is_none")]
    pub sample_rate: Option<f64>,
    /// Interleaved channels.
    #[serde(rename = "core:num_channels", default, skip_serializing_if = "Option::is_none")]
    pub num_channels: Option<usize>,
    /// Name of the sample file in the same folder, if it is not the metadata's own with the ending
    /// sigmf-data.
    #[serde(rename = "core:dataset", default, skip_serializing_if = "Option::is_none")]
    pub dataset: Option<String>,
    /// Number of the file's first frame, where a recording was split into several files.
    #[serde(rename = "core:offset", default, skip_serializing_if = "is_zero")]
    pub offset: u64,
    /// Bytes after the last frame that are not samples.
    #[serde(rename = "core:trailing_bytes", default, skip_serializing_if = "is_zero")]
    pub trailing_bytes: u64,
    /// Whether the samples were left out on purpose.
    #[serde(rename = "core:metadata_only", default, skip_serializing_if = "std::ops::Not::not")]
    pub metadata_only: bool,
    /// Version of SigMF.
    #[serde(rename = "core:version", default)]
    pub version: String,
    /// Author, hardware, licence, and all other members.
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

/// One of the `annotations`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SigmfAnnotation {
    /// Its first frame in the file.
    #[serde(rename = "core:sample_start")]
    pub sample_start: u64,
    /// Its frames.
    #[serde(rename = "core:sample_count", default, skip_serializing_if = "Option::is_none")]
    pub sample_count: Option<u64>,
    /// Label, comment, frequencies, and all other members.
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

/// One of the `captures`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SigmfCapture {
    /// Its first frame in the file.
    #[serde(rename = "core:sample_start")]
    pub sample_start: u64,
    /// Number of its first frame at the converter, which counts lost frames too.
    #[serde(rename = "core:global_index", default, skip_serializing_if = "Option::is_none")]
    pub global_index: Option<u64>,
    /// Bytes before the capture's first frame that are not samples.
    #[serde(rename = "core:header_bytes", default, skip_serializing_if = "is_zero")]
    pub header_bytes: u64,
    /// Date and time, frequency, and all other members.
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl SigmfMeta {
    /// One channel of fast samples.
    pub fn for_output(format: PcmFormat, is_complex: bool, rate: f64) -> Self {
        let datatype = format!("{}{}", if is_complex { 'c' } else { 'r' }, datatype(format));
        Self {
            global: SigmfGlobal {
                datatype,
                sample_rate: Some(rate),
                num_channels: Some(1),
                version: "1.0.0".into(),
                ..SigmfGlobal::default()
            },
            captures: vec![SigmfCapture::default()],
            annotations: Vec::new(),
        }
    }

    /// Reads a metadata file.
    ///
    /// # Errors
    /// [`IoError::File`] if it cannot be read or is too long, [`IoError::Malformed`] if it is malformed.
    pub fn read(path: &Path) -> Result<Self, IoError> {
        Self::parse(&read_text(path, META_FILE)?, &path.display().to_string())
    }

    /// As [`SigmfMeta::read`], from text; `file` is the name in error messages.
    ///
    /// # Errors
    /// [`IoError::Malformed`] if it is malformed, including its data type and captures.
    pub fn parse(text: &str, file: &str) -> Result<Self, IoError> {
        let fault = |problem| malformed(file, problem);
        let meta = serde_json::from_str(text).or_else(|error| {
            let numbers = without_nan(text);
            if numbers == text { Err(error) } else { serde_json::from_str(&numbers) }
        });
        let meta: Self = meta.map_err(|error| fault(of_json(&error.to_string())))?;
        meta.format(file)?;
        meta.timestamps(file)?;
        if meta.global.metadata_only {
            return Err(fault(
                "core:metadata_only is true, so there are no samples; give a recording".into(),
            ));
        }
        if let Some(name) = meta.required_extension() {
            return Err(fault(format!(
                "it needs the extension \"{}\", which is unknown here; convert the recording to one without",
                Quoted(name)
            )));
        }
        if let Some(name) = meta.global.dataset.as_deref().filter(|name| !is_file_name(name)) {
            return Err(fault(format!(
                "core:dataset is \"{}\"; it must be the name of a file in the same folder, without any path",
                Quoted(name)
            )));
        }
        match (meta.global.num_channels, meta.global.sample_rate) {
            (Some(count), _) if !(1..=MOST_CHANNELS).contains(&(count as u64)) => {
                Err(fault(format!("core:num_channels is {count}; it may be 1 to {MOST_CHANNELS}")))
            }
            (_, Some(rate)) if !(rate.is_finite() && rate > 0.0) => {
                Err(fault(format!("core:sample_rate is {}; a rate is greater than 0 Hz", Number(rate))))
            }
            _ => Ok(meta),
        }
    }

    /// The first extension without which the recording cannot be read.
    fn required_extension(&self) -> Option<&str> {
        let extensions = self.global.other.get("core:extensions")?.as_array()?;
        let required = |extension: &&Value| extension.get("optional") == Some(&Value::Bool(false));
        extensions.iter().find(required)?.get("name")?.as_str()
    }

    /// The SHA-512 of the file of samples, in hexadecimal digits, if it is stated.
    pub(super) fn sha512(&self) -> Option<&str> {
        self.global.other.get("core:sha512")?.as_str()
    }

    /// The format of the numbers of the data type.
    ///
    /// # Errors
    /// [`IoError::Malformed`] for types that no [`PcmFormat`] covers.
    pub fn format(&self, file: &str) -> Result<PcmFormat, IoError> {
        PcmFormat::ALL
            .into_iter()
            .find(|&format| self.global.datatype.strip_prefix(['r', 'c']) == Some(datatype(format).as_str()))
            .ok_or_else(|| {
                let datatype = Quoted(&self.global.datatype);
                malformed(file, format!(
                    "core:datatype is {datatype}; use ri8, ru8, ri16_le, ri32_le, rf32_le, rf64_le, their _be forms, or complex ones (cf32_le)",
                ))
            })
    }

    /// True if each sample is two numbers of the [format](Self::format).
    pub fn is_complex(&self) -> bool {
        self.global.datatype.starts_with('c')
    }

    /// The format of the frames; how many there are is not said.
    ///
    /// # Errors
    /// As [`SigmfMeta::format`].
    pub fn stream_header(&self, file: &str) -> Result<StreamHeader, IoError> {
        let layout = SampleLayout::packed(self.format(file)?);
        let real = StreamHeader::real(layout, self.global.num_channels.unwrap_or(1));
        Ok(StreamHeader { is_complex: self.is_complex(), rate: self.global.sample_rate, ..real })
    }

    /// Number of the first frame that is read: that of the first capture, before which there are none.
    pub(super) fn first_frame(&self) -> u64 {
        self.captures.first().map_or(0, |capture| capture.sample_start).max(self.global.offset)
    }

    /// When the frames that are read were taken.
    pub(super) fn timestamps(&self, file: &str) -> Result<Timestamps, IoError> {
        let fault = |problem| malformed(file, problem);
        if !self.captures.is_sorted_by_key(|capture| capture.sample_start) {
            return Err(fault("the captures are not in the order of their core:sample_start".into()));
        }
        let offset = self.first_frame();
        let timestamps = self.captures.iter().filter_map(|capture| {
            let frame = capture.sample_start.checked_sub(offset);
            capture.global_index.map(|index| frame.map(|frame| Timestamp { frame, index }))
        });
        let before = || fault(format!("a capture begins before core:offset {}", self.global.offset));
        let timestamps = timestamps.collect::<Option<Vec<_>>>().ok_or_else(before)?;
        Timestamps::new(timestamps).map_err(fault)
    }
}

/// The text with null in place of NaN and infinity, which JSON does not have, but Python writes.
fn without_nan(text: &str) -> String {
    let (mut is_quoted, mut kept) = (false, String::with_capacity(text.len()));
    for part in text.split_inclusive('"') {
        match is_quoted {
            true => kept.push_str(part),
            false => kept.push_str(
                &part.replace("-Infinity", "null").replace("Infinity", "null").replace("NaN", "null"),
            ),
        }
        let is_escaped =
            is_quoted && part.trim_end_matches('"').chars().rev().take_while(|c| *c == '\\').count() % 2 == 1;
        is_quoted ^= !is_escaped;
    }
    kept
}

pub(super) fn malformed(file: &str, problem: String) -> IoError {
    IoError::malformed(file, "a SigMF recording")(problem)
}

/// The data type's name without its leading r.
fn datatype(format: PcmFormat) -> String {
    let name = format.name();
    let (kind, rest) = name.split_at(1);
    let kind = if kind == "s" { "i" } else { kind };
    let (bits, order) = rest.split_at(rest.find(['l', 'b']).unwrap_or(rest.len()));
    if order.is_empty() { format!("{kind}{bits}") } else { format!("{kind}{bits}_{order}") }
}

/// True for a name that stays in its folder.
fn is_file_name(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let plain = matches!(parts.next(), Some(Component::Normal(part)) if part == name);
    plain && parts.next().is_none() && !name.contains(['\\', '\0'])
}

/// The two files of a recording, given either of them.
pub(super) fn file_pair(path: &Path, meta: Option<&SigmfMeta>) -> (PathBuf, PathBuf) {
    let data = match meta.and_then(|meta| meta.global.dataset.as_ref()) {
        Some(name) => path.with_file_name(name),
        None => path.with_extension("sigmf-data"),
    };
    (path.with_extension("sigmf-meta"), data)
}

/// The two files of the recording that `path` names, metadata and samples. The samples lie in the file that
/// the metadata name, if they can be read.
pub fn sigmf_files(path: &Path) -> [PathBuf; 2] {
    let meta = path.with_extension("sigmf-meta");
    // What a pipe holds can be read only once.
    let meta = meta.is_file().then(|| SigmfMeta::read(&meta).ok()).flatten();
    file_pair(path, meta.as_ref()).into()
}

/// True for the names of SigMF's two files.
pub fn is_sigmf(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "sigmf-meta" || extension == "sigmf-data")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meta(datatype: &str, captures: &[(u64, Option<u64>)]) -> SigmfMeta {
        let capture = |&(sample_start, global_index): &_| SigmfCapture {
            sample_start,
            global_index,
            ..SigmfCapture::default()
        };
        let mut meta = SigmfMeta::for_output(PcmFormat::F32Le, false, 1.0);
        meta.global.datatype = datatype.into();
        SigmfMeta { captures: captures.iter().map(capture).collect(), ..meta }
    }

    #[test]
    fn every_format_has_a_name_and_back() {
        let names: Vec<String> = PcmFormat::ALL.into_iter().map(|f| format!("r{}", datatype(f))).collect();
        let want = [
            "ri8", "ru8", "ri16_le", "ri16_be", "ri24_le", "ri24_be", "ri32_le", "ri32_be", "ru16_le",
            "ru16_be", "ru32_le", "ru32_be", "ri64_le", "ri64_be", "rf16_le", "rf16_be", "rf32_le",
            "rf32_be", "rf64_le", "rf64_be",
        ];
        assert_eq!(names, want);
        for (name, format) in want.into_iter().zip(PcmFormat::ALL) {
            assert_eq!(meta(name, &[]).format("test").unwrap(), format);
        }
        let complex = meta("cf32_le", &[]);
        assert!(complex.is_complex() && complex.format("test").unwrap() == PcmFormat::F32Le);
        let error = meta("xf32_le", &[]).format("test").unwrap_err().to_string();
        assert!(error.contains("xf32_le") && error.contains("ri16_le"), "{error}");
    }

    #[test]
    fn captures_with_an_index_are_the_sequence() {
        let timestamp = |frame, index| Timestamp { frame, index };
        let sequence = Timestamps::new(vec![timestamp(0, 100), timestamp(5, 107)]).unwrap();
        let mut recording = meta("ri8", &[(10, Some(100)), (12, None), (15, Some(107))]);
        // Frames before the first capture are none of it; those of a recording that was split count from its
        // offset.
        for offset in [0, 10] {
            recording.global.offset = offset;
            assert_eq!(recording.timestamps("test").unwrap(), sequence, "{offset}");
        }
        assert!(meta("ri8", &[(0, None), (5, None)]).timestamps("test").unwrap().is_empty());
    }

    #[test]
    fn captures_that_cannot_be_are_refused() {
        let refused = |recording: SigmfMeta| recording.timestamps("test").unwrap_err().to_string();
        let overlap = refused(meta("ri8", &[(0, Some(5)), (4, Some(6))]));
        assert!(overlap.contains("must not overlap"), "{overlap}");
        let disorder = refused(meta("ri8", &[(4, None), (2, None)]));
        assert!(disorder.contains("not in the order"), "{disorder}");
        let mut recording = meta("ri8", &[(4, Some(9))]);
        recording.global.offset = 5;
        assert!(refused(recording.clone()).contains("before core:offset 5"));
        for (key, value) in [("num_channels", "0"), ("num_channels", "99999999"), ("sample_rate", "-1")] {
            let text = format!(r#"{{"global":{{"core:datatype":"ri8","core:{key}":{value}}}}}"#);
            let error = SigmfMeta::parse(&text, "test").unwrap_err().to_string();
            assert!(error.starts_with("test: ") && error.contains(key), "{error}");
        }
    }

    #[test]
    fn numbers_that_json_lacks_are_left_out() {
        let text =
            r#"{"global": {"core:datatype": "ri8", "x": NaN, "y": [-Infinity, 1], "z \" NaN": "NaN"}}"#;
        let meta = SigmfMeta::parse(text, "test").unwrap();
        assert!(meta.global.other["x"].is_null() && meta.global.other["z \" NaN"] == "NaN");
        assert!(SigmfMeta::parse(r#"{"global": {"core:datatype": "ri8", "x": nan}}"#, "test").is_err());
    }

    #[test]
    fn the_samples_stay_beside_their_metadata() {
        let text = |name: &str| format!(r#"{{"global":{{"core:datatype":"ri8","core:dataset":"{name}"}}}}"#);
        for name in ["/dev/zero", "../other", "..", ".", "sub/data", "data/", "./data", "a\\\\b", ""] {
            let error = SigmfMeta::parse(&text(name), "test").unwrap_err().to_string();
            assert!(error.contains("core:dataset") && error.contains("same folder"), "{name}: {error}");
        }
        for name in ["data", "data.bin", "..data"] {
            assert!(SigmfMeta::parse(&text(name), "test").is_ok(), "{name}");
        }
    }
}
