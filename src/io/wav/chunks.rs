//! Reads a WAV header chunk by chunk, without seeking.

use crate::io::IoError;
use std::io::{self, Read};

/// The 12 bytes that end the GUIDs of Wave64's `wave`, `fmt ` and `data`.
const W64_TAIL: [u8; 12] = [0xF3, 0xAC, 0xD3, 0x11, 0x8C, 0xD1, 0x00, 0xC0, 0x4F, 0x8E, 0xDB, 0x8A];

/// Names that may follow an odd chunk at once, where a writer forgot the pad byte.
const KNOWN: [&[u8; 4]; 16] = [
    b"data", b"fmt ", b"fact", b"LIST", b"JUNK", b"junk", b"PAD ", b"FLLR", b"bext", b"cue ", b"smpl",
    b"inst", b"PEAK", b"id3 ", b"iXML", b"ds64",
];

/// Which of the three families the file belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Family {
    /// Sizes of 32 bits.
    Riff,
    /// RF64 or BW64: a ds64 chunk holds the true sizes.
    Rf64,
    /// Sony Wave64: GUIDs, sizes of 64 bits that count their own header.
    W64,
}

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
    pub(super) family: Family,
    /// The size that the outermost chunk promises, counted from the first byte of the file.
    pub(super) promised: u64,
    /// An odd chunk has just ended, so a pad byte should follow.
    pad_due: bool,
}

impl<'a, R: Read> Chunks<'a, R> {
    /// Reads the outermost head.
    pub(super) fn open(inner: R, file: &'a str) -> Result<Self, IoError> {
        let mut chunks = Self { inner, file, offset: 0, family: Family::Riff, promised: 0, pad_due: false };
        let id: [u8; 4] = chunks.bytes("the first four bytes")?;
        match &id {
            b"RIFF" => chunks.open_riff(Family::Riff)?,
            b"RF64" | b"BW64" => chunks.open_riff(Family::Rf64)?,
            b"riff" => chunks.open_w64()?,
            _ => return Err(chunks.not_wav(&id)),
        }
        Ok(chunks)
    }

    fn not_wav(&self, found: &[u8]) -> IoError {
        IoError::NotWav { file: self.file.to_owned(), found: format!("`{}`", found.escape_ascii()) }
    }

    fn open_riff(&mut self, family: Family) -> Result<(), IoError> {
        self.family = family;
        self.promised = u64::from(u32::from_le_bytes(self.bytes("the RIFF head")?)) + 8;
        match &self.bytes("the RIFF head")? {
            b"WAVE" => Ok(()),
            other => Err(self.not_wav(other)),
        }
    }

    fn open_w64(&mut self) -> Result<(), IoError> {
        self.family = Family::W64;
        let _guid: [u8; 12] = self.bytes("the W64 head")?;
        self.promised = u64::from_le_bytes(self.bytes("the W64 head")?);
        let wave: [u8; 16] = self.bytes("the W64 head")?;
        if &wave[..4] == b"wave" { Ok(()) } else { Err(self.not_wav(&wave[..4])) }
    }

    /// The next chunk's head, or `None` where the bytes end between chunks.
    pub(super) fn next(&mut self) -> Result<Option<Chunk>, IoError> {
        match self.family {
            Family::W64 => self.next_w64(),
            _ => self.next_riff(),
        }
    }

    fn next_riff(&mut self) -> Result<Option<Chunk>, IoError> {
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

    fn next_w64(&mut self) -> Result<Option<Chunk>, IoError> {
        let mut guid = [0; 16];
        if self.read_some(&mut guid)? < 16 {
            return Ok(None);
        }
        let place = self.offset;
        let size = u64::from_le_bytes(self.bytes("a W64 chunk head")?);
        let id = if guid[4..] == W64_TAIL { [guid[0], guid[1], guid[2], guid[3]] } else { *b"????" };
        // The size counts the 24 bytes of the head; a streamed data chunk may say 0.
        match size.checked_sub(24) {
            Some(size) => Ok(Some(Chunk { id, size, offset: self.offset })),
            None if &id == b"data" => Ok(Some(Chunk { id, size: 0, offset: self.offset })),
            None => Err(self.bad("the chunk size", place, size, "a W64 chunk counts its own 24 bytes")),
        }
    }

    /// Passes over the rest of a chunk of which `used` bytes were read.
    pub(super) fn skip(&mut self, chunk: Chunk, used: u64) -> Result<(), IoError> {
        let padding = if self.family == Family::W64 { chunk.size.wrapping_neg() % 8 } else { 0 };
        let left = chunk.size.saturating_sub(used).saturating_add(padding);
        let passed = io::copy(&mut (&mut self.inner).take(left), &mut io::sink());
        self.offset += passed.map_err(IoError::system(self.file, "read the header"))?;
        Ok(())
    }

    /// Exactly B bytes, or the error that the header ends in `place`.
    pub(super) fn bytes<const B: usize>(&mut self, place: &'static str) -> Result<[u8; B], IoError> {
        let mut bytes = [0; B];
        self.exact(&mut bytes, place)?;
        Ok(bytes)
    }

    /// Fills `bytes`, or returns the error that the header ends in `place`.
    pub(super) fn exact(&mut self, bytes: &mut [u8], place: &'static str) -> Result<(), IoError> {
        if self.read_some(bytes)? == bytes.len() {
            return Ok(());
        }
        let offset = self.offset;
        Err(self.malformed(format!(
            "the header ends at byte {offset} inside {place}; the file is truncated, record or copy it again"
        )))
    }

    fn read_some(&mut self, bytes: &mut [u8]) -> Result<usize, IoError> {
        let mut filled = 0;
        while filled < bytes.len() {
            match self.inner.read(&mut bytes[filled..]) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(IoError::system(self.file, "read the header")(error)),
            }
        }
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
