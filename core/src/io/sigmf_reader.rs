//! The samples of SigMF recordings.

use super::capture::{ByteSource, InputNotes, open_file};
use super::sigmf::{SigmfMeta, file_pair, malformed};
use super::timestamps::Timestamps;
use super::{IoError, StreamHeader};
use crate::messages::Quoted;
use sha2::{Digest as _, Sha512};
use std::fs::File;
use std::io::{self, Read, Take};
use std::path::Path;

/// A recording, which reads as its samples.
pub(super) struct SigmfReader {
    meta: Box<SigmfMeta>,
    header: StreamHeader,
    timestamps: Timestamps,
    samples: Take<File>,
    /// Of what has been read, if the metadata state one.
    digest: Option<Sha512>,
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
        // A file may grow while it is read.
        Self::new(meta, &meta_path.display().to_string(), file.take(u64::MAX), bytes)
    }

    /// Of `samples`, of `bytes` bytes if that is known, with their metadata, called `name`.
    fn new(
        meta: SigmfMeta,
        name: &str,
        mut samples: Take<File>,
        mut bytes: Option<u64>,
    ) -> Result<Self, IoError> {
        let trailing = meta.global.trailing_bytes;
        if trailing > 0 {
            let problem = || match bytes {
                None => format!("core:trailing_bytes is {trailing}, but the samples come from a pipe"),
                Some(bytes) => format!("core:trailing_bytes is {trailing}, but there are {bytes} bytes"),
            };
            let kept = bytes.and_then(|bytes| bytes.checked_sub(trailing));
            let kept = kept.ok_or_else(|| malformed(name, problem()))?;
            samples.set_limit(kept);
            bytes = Some(kept);
        }
        let header = meta.stream_header(name)?;
        let promised = bytes.map(|bytes| bytes / header.frame_bytes() as u64);
        let (header, timestamps) = (StreamHeader { promised, ..header }, meta.timestamps(name)?);
        let digest = meta.sha512().map(|_| Sha512::new());
        Ok(Self { meta: Box::new(meta), header, timestamps, samples, digest })
    }
}

impl Read for SigmfReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.samples.read(bytes)?;
        self.digest.iter_mut().for_each(|digest| digest.update(&bytes[..count]));
        Ok(count)
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

    fn is_altered(&mut self) -> bool {
        // The digest is that of the whole file.
        self.samples.set_limit(self.meta.global.trailing_bytes);
        let mut bytes = [0; 4096];
        while self.digest.is_some() && self.read(&mut bytes).is_ok_and(|count| count > 0) {}
        let digits = |digest: Sha512| digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        let found: Option<String> = self.digest.take().map(digits);
        found
            .is_some_and(|found| self.meta.sha512().is_some_and(|stated| !found.eq_ignore_ascii_case(stated)))
    }
}
