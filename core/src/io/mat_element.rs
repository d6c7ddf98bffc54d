//! Data elements of MATLAB files: a tag with type and size, and bytes.

use crate::files::fill;
use std::io::{self, Read};

/// Most bytes of the numbers of an array, which are held in memory.
const MOST_BYTES: u64 = 1 << 30;

/// Type and size of an element.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tag {
    pub(super) kind: u32,
    pub(super) size: u64,
    /// The bytes of an element of up to four of them, which stand in its tag.
    small: Option<[u8; 4]>,
}

/// Type of a variable, and of a compressed one.
pub(super) const MATRIX: u32 = 14;
pub(super) const COMPRESSED: u32 = 15;

impl Tag {
    /// Bytes of a tag.
    pub(super) const BYTES: u64 = 8;

    /// `None` at the end.
    pub(super) fn read(reader: &mut impl Read) -> io::Result<Option<Self>> {
        let mut bytes = [0; 8];
        match fill(reader, &mut bytes)? {
            0 => return Ok(None),
            8 => {}
            _ => return Err(io::ErrorKind::UnexpectedEof.into()),
        }
        let [a, b, c, d, e, f, g, h] = bytes;
        let (first, second) = (u32::from_le_bytes([a, b, c, d]), [e, f, g, h]);
        let small = u64::from(first >> 16);
        Ok(Some(match small {
            0 => Self { kind: first, size: u64::from(u32::from_le_bytes(second)), small: None },
            _ => Self { kind: first & 0xFFFF, size: small, small: Some(second) },
        }))
    }

    /// Bytes after the tag.
    pub(super) fn after(self) -> u64 {
        if self.small.is_some() { 0 } else { self.size }
    }

    /// The bytes of the element after its tag, at most `most`.
    pub(super) fn content(self, reader: &mut impl Read, most: u64) -> Result<Vec<u8>, String> {
        if let Some(bytes) = self.small {
            let known = bytes.get(..self.size as usize).ok_or("a tag is damaged; save the file again")?;
            return Ok(known.to_vec());
        }
        if self.size > most {
            return Err(format!("{} bytes, more than {most}; save a part of it", self.size));
        }
        let mut bytes = Vec::new();
        // Elements are filled up to eight bytes; the last one of a file may not be.
        let padding = self.size.next_multiple_of(8) - self.size;
        let read = reader.by_ref().take(self.size).read_to_end(&mut bytes);
        read.and_then(|_| io::copy(&mut reader.by_ref().take(padding), &mut io::sink()))
            .map_err(unreadable)?;
        if (bytes.len() as u64) < self.size {
            return Err(format!("it ends after {} of {} bytes; copy it again", bytes.len(), self.size));
        }
        Ok(bytes)
    }
}

/// As a problem of a file.
pub(super) fn unreadable(error: io::Error) -> String {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => "it ends inside a variable; copy it again".into(),
        io::ErrorKind::InvalidInput => "its compressed bytes are damaged; copy it again".into(),
        _ => format!("cannot read it: {error}"),
    }
}

/// The numbers of one part of an array, as stored.
#[derive(Debug)]
pub(super) struct Numbers {
    kind: u32,
    bytes: Vec<u8>,
}

impl Numbers {
    /// `count` numbers; they may have fewer bytes than their class.
    pub(super) fn read(reader: &mut impl Read, count: u64) -> Result<Self, String> {
        let tag = Tag::read(reader).map_err(unreadable)?;
        let tag = tag.ok_or("its numbers are missing; copy it again")?;
        let size = Self::size(tag.kind)
            .ok_or_else(|| format!("numbers of type {}, which is unknown; save it again", tag.kind))?;
        if count.checked_mul(size) != Some(tag.size) {
            let stored = tag.size / size;
            return Err(format!("its shape needs {count} numbers, but there are {stored}; save it again"));
        }
        Ok(Self { kind: tag.kind, bytes: tag.content(reader, MOST_BYTES)? })
    }

    /// Bytes of a number of this type.
    fn size(kind: u32) -> Option<u64> {
        match kind {
            1 | 2 => Some(1),
            3 | 4 => Some(2),
            5..=7 => Some(4),
            9 | 12 | 13 => Some(8),
            _ => None,
        }
    }

    /// Number `index`.
    pub(super) fn get(&self, index: usize) -> Option<f64> {
        let size = Self::size(self.kind)? as usize;
        let bytes = self.bytes.get(index.checked_mul(size)?..)?;
        Some(match self.kind {
            1 => f64::from(i8::from_le_bytes(first(bytes)?)),
            2 => f64::from(u8::from_le_bytes(first(bytes)?)),
            3 => f64::from(i16::from_le_bytes(first(bytes)?)),
            4 => f64::from(u16::from_le_bytes(first(bytes)?)),
            5 => f64::from(i32::from_le_bytes(first(bytes)?)),
            6 => f64::from(u32::from_le_bytes(first(bytes)?)),
            7 => f64::from(f32::from_le_bytes(first(bytes)?)),
            9 => f64::from_le_bytes(first(bytes)?),
            12 => i64::from_le_bytes(first(bytes)?) as f64,
            _ => u64::from_le_bytes(first(bytes)?) as f64,
        })
    }
}

/// The first `N` bytes.
fn first<const N: usize>(bytes: &[u8]) -> Option<[u8; N]> {
    bytes.first_chunk().copied()
}
