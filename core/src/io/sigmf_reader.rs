//! The samples of SigMF recordings.

use super::capture::{ByteSource, InputNotes, open_file};
use super::sigmf::{SigmfMeta, file_pair, malformed};
use super::timestamps::Timestamps;
use super::{IoError, StreamHeader};
use crate::messages::Quoted;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// A recording, which reads as its samples.
pub(super) struct SigmfReader {
    meta: Box<SigmfMeta>,
    header: StreamHeader,
    timestamps: Timestamps,
    file: File,
    /// Bytes before the first capture that have not been passed.
    before: u64,
}

impl SigmfReader {
    /// Opens the recording that the name of either of its files means.
    pub(super) fn open(path: &Path) -> Result<Self, IoError> {
        let (meta_path, _) = file_pair(path, None);
        let meta = SigmfMeta::read(&meta_path)?;
        let (_, data_path) = file_pair(path, Some(&meta));
        // To open a pipe without a writer would take for ever. Without core:dataset the samples may come
        // from one.
        let problem = match &meta.global.dataset {
            Some(name) if data_path.exists() && !data_path.is_file() => {
                Some(format!("core:dataset leads to \"{}\"", Quoted(name)))
            }
            None if data_path.is_dir() => Some(format!("its samples would be in {}", Quoted(&data_path))),
            _ => None,
        };
        if let Some(problem) = problem {
            let problem = format!("{problem}, which is no file; give one with samples");
            return Err(malformed(&meta_path.display().to_string(), problem));
        }
        let file = open_file(&data_path)?;
        let bytes = file.metadata().ok().filter(|data| data.is_file()).map(|data| data.len());
        let name = meta_path.display().to_string();
        let (header, timestamps) = (meta.stream_header(&name)?, meta.timestamps(&name)?);
        let frame = header.frame_bytes() as u64;
        let before = (meta.first_frame() - meta.global.offset).saturating_mul(frame);
        let promised = bytes.map(|bytes| bytes.saturating_sub(before) / frame);
        // From here on frames count from the first one that is read.
        let mut meta = Box::new(meta);
        meta.global.offset = meta.first_frame();
        Ok(Self { meta, header: StreamHeader { promised, ..header }, timestamps, file, before })
    }

    /// Bytes of the file before its first sample.
    pub(super) fn beginning(&self) -> u64 {
        self.before
    }
}

impl Read for SigmfReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let before = std::mem::take(&mut self.before);
        io::copy(&mut (&mut self.file).take(before), &mut io::sink())?;
        self.file.read(bytes)
    }
}

impl ByteSource for SigmfReader {
    fn stream_header(&self) -> StreamHeader {
        self.header
    }

    fn notes(&self) -> InputNotes {
        let (sigmf, timestamps) = (Some(self.meta.clone()), self.timestamps.clone());
        InputNotes { sigmf, timestamps, ..InputNotes::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(captures: &str, data: &[u8]) -> (Option<u64>, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let meta = folder.path().join("x.sigmf-meta");
        let text = format!(r#"{{"global": {{"core:datatype": "ri8"}}, "captures": [{captures}]}}"#);
        std::fs::write(&meta, text).unwrap();
        std::fs::write(meta.with_extension("sigmf-data"), data).unwrap();
        let mut reader = SigmfReader::open(&meta).unwrap();
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).unwrap();
        (reader.stream_header().promised, bytes)
    }

    #[test]
    fn what_stands_before_the_first_capture_is_no_sample() {
        let capture = |start: u64| format!(r#"{{"core:sample_start": {start}}}"#);
        let data: Vec<u8> = (0..20).collect();
        assert_eq!(read("", &data), (Some(20), data.clone()));
        assert_eq!(read(&capture(3), &data), (Some(17), data[3..].to_vec()));
        assert_eq!(read(&[capture(2), capture(6)].join(","), &data), (Some(18), data[2..].to_vec()));
        assert_eq!(read(&capture(30), &data), (Some(0), Vec::new()));
    }
}
