//! The samples of SigMF recordings.

use super::capture::{ByteSource, InputNotes, open_file};
use super::sigmf::{SigmfCapture, SigmfMeta, file_pair, malformed};
use super::timestamps::Timestamps;
use super::{IoError, StreamHeader};
use crate::messages::Quoted;
use sha2::{Digest as _, Sha512};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read, Take};
use std::path::Path;

/// A recording, which reads as its samples.
pub(super) struct SigmfReader {
    meta: Box<SigmfMeta>,
    header: StreamHeader,
    timestamps: Timestamps,
    file: Take<File>,
    /// What in the file is not read, in its order.
    left_out: VecDeque<LeftOut>,
    /// Bytes of samples so far.
    read: u64,
    /// Of what has been read, if the metadata state one.
    digest: Option<Sha512>,
}

/// Bytes that are not read.
#[derive(Debug, Clone, Copy)]
struct LeftOut {
    /// After so many bytes of samples.
    after: u64,
    bytes: u64,
}

/// What stands before the first capture, and the headers of all captures.
fn left_out(meta: &SigmfMeta, frame_bytes: u64) -> VecDeque<LeftOut> {
    let first = meta.first_frame();
    let before = LeftOut { after: 0, bytes: (first - meta.global.offset).saturating_mul(frame_bytes) };
    let header = |capture: &SigmfCapture| LeftOut {
        after: capture.sample_start.saturating_sub(first).saturating_mul(frame_bytes),
        bytes: capture.header_bytes,
    };
    let all = std::iter::once(before).chain(meta.captures.iter().map(header));
    all.filter(|one| one.bytes > 0).collect()
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
        let left_out = left_out(&meta, header.frame_bytes() as u64);
        let other = left_out.iter().map(|one| one.bytes).fold(0, u64::saturating_add);
        let promised = bytes.map(|bytes| bytes.saturating_sub(other) / header.frame_bytes() as u64);
        let (header, timestamps) = (StreamHeader { promised, ..header }, meta.timestamps(name)?);
        let digest = meta.sha512().map(|_| Sha512::new());
        // From here on frames count from the first one that is read.
        let mut meta = Box::new(meta);
        meta.global.offset = meta.first_frame();
        Ok(Self { meta, header, timestamps, file: samples, left_out, read: 0, digest })
    }

    /// Bytes of the file before its first sample, if samples alone follow.
    pub(super) fn beginning(&self) -> Option<u64> {
        match self.left_out.iter().all(|one| one.after == 0) {
            true => Some(self.left_out.iter().map(|one| one.bytes).sum()),
            false => None,
        }
    }

    fn read_digested(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(bytes)?;
        self.digest.iter_mut().for_each(|digest| digest.update(&bytes[..count]));
        Ok(count)
    }

    /// Passes what is not read here.
    fn pass(&mut self) -> io::Result<()> {
        let mut bytes = [0; 4096];
        while let Some(LeftOut { bytes: left, .. }) =
            self.left_out.front_mut().filter(|one| one.after == self.read)
        {
            let most = (*left).min(bytes.len() as u64);
            if most == 0 {
                self.left_out.pop_front();
                continue;
            }
            *left -= most;
            let mut passed = 0;
            while passed < most as usize {
                match self.read_digested(&mut bytes[passed..most as usize])? {
                    0 => return Ok(()),
                    count => passed += count,
                }
            }
        }
        Ok(())
    }
}

impl Read for SigmfReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.pass()?;
        let until = self.left_out.front().map_or(u64::MAX, |next| next.after - self.read);
        let most = usize::try_from(until).unwrap_or(usize::MAX).min(bytes.len());
        let count = self.read_digested(&mut bytes[..most])?;
        self.read += count as u64;
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
        self.file.set_limit(self.meta.global.trailing_bytes);
        let mut bytes = [0; 4096];
        while self.digest.is_some() && self.read_digested(&mut bytes).is_ok_and(|count| count > 0) {}
        let digits = |digest: Sha512| digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        let found: Option<String> = self.digest.take().map(digits);
        found
            .is_some_and(|found| self.meta.sha512().is_some_and(|stated| !found.eq_ignore_ascii_case(stated)))
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
    fn headers_and_what_stands_before_the_first_capture_are_no_samples() {
        let of = |start: u64, header: u64| {
            format!(r#"{{"core:sample_start": {start}, "core:header_bytes": {header}}}"#)
        };
        let data: Vec<u8> = (0..20).collect();
        assert_eq!(read("", &data), (Some(20), data.clone()));
        assert_eq!(read(&of(0, 4), &data), (Some(16), data[4..].to_vec()));
        assert_eq!(read(&of(3, 0), &data), (Some(17), data[3..].to_vec()));
        let two = [of(2, 3), of(6, 5)].join(",");
        assert_eq!(read(&two, &data), (Some(10), [&data[5..9], &data[14..]].concat()));
        // A header that is cut.
        assert_eq!(read(&[of(0, 0), of(18, 9)].join(","), &data).1, data[..18]);
    }
}
