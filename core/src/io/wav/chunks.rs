//! Reads a WAV header chunk by chunk, without seeking.

use crate::files::fill;
use crate::io::IoError;
use std::io::{self, Read};

/// Names that may follow an odd chunk at once, where a writer forgot the pad byte.
pub(super) const KNOWN: [&[u8; 4]; 16] = [
    b"data", b"fmt ", b"fact", b"LIST", b"JUNK", b"junk", b"PAD ", b"FLLR", b"bext", b"cue ", b"smpl",
    b"inst", b"PEAK", b"id3 ", b"iXML", b"ds64",
];

/// The head of one chunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chunk {
    pub(super) id: [u8; 4],
    /// Bytes of content, as written.
    pub(super) size: u64,
    /// Where the content begins.
    pub(super) offset: u64,
}

/// A byte source with its name and offset.
#[derive(Debug)]
pub(super) struct Chunks<'a, R> {
    inner: R,
    file: &'a str,
    offset: u64,
    /// RF64 or BW64: a ds64 chunk holds the true sizes.
    pub(super) is_rf64: bool,
    /// The size that the outermost chunk promises, counted from the first byte of the file.
    pub(super) promised: u64,
    /// An odd chunk has just ended, so a pad byte should follow.
    pad_due: bool,
}

impl<'a, R: Read> Chunks<'a, R> {
    /// Reads the outermost head.
    pub(super) fn open(inner: R, file: &'a str) -> Result<Self, IoError> {
        let mut chunks = Self { inner, file, offset: 0, is_rf64: false, promised: 0, pad_due: false };
        let id: [u8; 4] = chunks.bytes("the first four bytes")?;
        chunks.is_rf64 = matches!(&id, b"RF64" | b"BW64");
        if &id != b"RIFF" && !chunks.is_rf64 {
            return Err(chunks.not_wav(&id));
        }
        chunks.promised = u64::from(u32::from_le_bytes(chunks.bytes("the RIFF head")?)) + 8;
        match &chunks.bytes("the RIFF head")? {
            b"WAVE" => Ok(chunks),
            other => Err(chunks.not_wav(other)),
        }
    }

    fn not_wav(&self, found: &[u8]) -> IoError {
        IoError::NotWav { file: self.file.to_owned(), found: format!("`{}`", found.escape_ascii()) }
    }

    /// The next chunk's head, or `None` where the bytes end between chunks.
    pub(super) fn next(&mut self) -> Result<Option<Chunk>, IoError> {
        let mut id = [0; 4];
        if self.read_some(&mut id)? < 4 {
            return Ok(None);
        }
        // An odd chunk is followed by a pad byte, unless its writer forgot: then a name is here.
        if std::mem::take(&mut self.pad_due) && !KNOWN.contains(&&id) {
            id.rotate_left(1);
            [id[3]] = self.bytes("a chunk head")?;
        }
        let size = u64::from(u32::from_le_bytes(self.bytes("a chunk head")?));
        self.pad_due = size % 2 == 1;
        Ok(Some(Chunk { id, size, offset: self.offset }))
    }

    /// Passes over the rest of a chunk of which `used` bytes were read.
    pub(super) fn skip(&mut self, chunk: Chunk, used: u64) -> Result<(), IoError> {
        let left = chunk.size.saturating_sub(used);
        let passed = io::copy(&mut (&mut self.inner).take(left), &mut io::sink());
        self.offset += passed.map_err(IoError::system(self.file, "read the header"))?;
        Ok(())
    }

    /// Exactly B bytes, or the error that the header ends in `part`.
    pub(super) fn bytes<const B: usize>(&mut self, part: &'static str) -> Result<[u8; B], IoError> {
        let mut bytes = [0; B];
        self.exact(&mut bytes, part)?;
        Ok(bytes)
    }

    /// Fills `bytes`, or returns the error that the header ends in `part`.
    pub(super) fn exact(&mut self, bytes: &mut [u8], part: &'static str) -> Result<(), IoError> {
        if self.read_some(bytes)? == bytes.len() {
            return Ok(());
        }
        let offset = self.offset;
        Err(self.malformed(format!(
            "the header ends at byte {offset} inside {part}; the file is truncated, record or copy it again"
        )))
    }

    fn read_some(&mut self, bytes: &mut [u8]) -> Result<usize, IoError> {
        let filled = fill(&mut self.inner, bytes).map_err(IoError::system(self.file, "read the header"))?;
        self.offset += filled as u64;
        Ok(filled)
    }

    /// An error about a field.
    pub(super) fn bad(&self, field: &str, offset: u64, value: u64, rule: &str) -> IoError {
        self.malformed(format!("{field} at byte {offset} is {value}; {rule}"))
    }

    /// An error about the file.
    pub(super) fn malformed(&self, problem: String) -> IoError {
        IoError::malformed(self.file, "a WAV file")(problem)
    }

    /// Where the next byte is.
    pub(super) fn offset(&self) -> u64 {
        self.offset
    }

    /// The source, placed at the first sample.
    pub(super) fn into_inner(self) -> R {
        self.inner
    }
}
