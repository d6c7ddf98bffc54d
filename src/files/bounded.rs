//! Reads whole files up to a maximum size. A device, for example, never ends.

use super::FileError;
use crate::memory::check_memory;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Maximum size of a kind of file.
#[derive(Debug, Clone, Copy)]
pub struct Bound {
    /// The most bytes.
    pub bytes: u64,
    /// The kind, with its article: `a bank file`.
    pub kind: &'static str,
    /// What to do about a longer one.
    pub remedy: &'static str,
}

/// Specs and banks; the largest bank with its proof is smaller.
pub const SPEC_OR_BANK: Bound =
    Bound { bytes: 256 << 20, kind: "a spec or bank file", remedy: "give the file that was meant" };

/// Bytes of memory that a number or a key of a text takes while it is read, and an object with its members.
const PART_BYTES: f64 = 200.0;
const OBJECT_BYTES: f64 = 800.0;
/// Of a dot between the parts of a key, `a.b`, each of which is a table.
const DOTTED_BYTES: f64 = 1500.0;

/// Bytes of memory that parsing a text takes, about: JSON, TOML or lines. Long strings take up to four times
/// as much.
fn parsing_bytes(text: &[u8]) -> f64 {
    let mut is_quoted = false;
    let following = text.iter().skip(1).chain(b"\n");
    let of = |(byte, next): (&u8, &u8)| {
        match byte {
            b'"' => is_quoted = !is_quoted,
            b'\n' => is_quoted = false,
            _ => {}
        }
        match byte {
            b',' | b'\n' | b'=' => PART_BYTES,
            b'{' | b'[' => OBJECT_BYTES,
            b'.' if !is_quoted && !next.is_ascii_digit() => DOTTED_BYTES,
            _ => 1.0,
        }
    };
    text.iter().zip(following).map(of).sum()
}

/// The bytes of a file.
///
/// # Errors
/// The system's refusal, or [`FileError::TooLong`].
pub fn read_bytes(path: &Path, bound: Bound) -> Result<Vec<u8>, FileError> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(FileError::system(&name, "read it"))?;
    bytes_of(file, &name, bound)
}

/// The text of a file.
///
/// # Errors
/// As [`read_bytes`], or [`FileError::NotText`].
pub fn read_text(path: &Path, bound: Bound) -> Result<String, FileError> {
    text_in(read_bytes(path, bound)?, &path.display().to_string())
}

/// The bytes of a stream called `name`.
///
/// # Errors
/// As [`read_bytes`].
pub fn bytes_of(stream: impl Read, name: &str, bound: Bound) -> Result<Vec<u8>, FileError> {
    let mut bytes = Vec::new();
    let read = stream.take(bound.bytes.saturating_add(1)).read_to_end(&mut bytes);
    read.map_err(FileError::system(name, "read it"))?;
    if bytes.len() as u64 > bound.bytes {
        let Bound { bytes: most, kind, remedy } = bound;
        return Err(FileError::TooLong { file: name.to_owned(), most, kind, remedy });
    }
    Ok(bytes)
}

/// The text that `bytes`, read from what is called `name`, hold.
///
/// # Errors
/// [`FileError::NotText`], and [`FileError::Memory`] if the process may not use what parsing it takes.
pub fn text_in(bytes: Vec<u8>, name: &str) -> Result<String, FileError> {
    check_memory(parsing_bytes(&bytes))
        .map_err(|shortage| FileError::Memory { file: name.to_owned(), shortage })?;
    String::from_utf8(bytes).map_err(|error| FileError::NotText {
        file: name.to_owned(),
        offset: error.utf8_error().valid_up_to(),
    })
}

/// Reads until `bytes` are full or the end; gives how many there are.
#[cfg(feature = "runtime")]
pub(crate) fn fill(reader: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<usize> {
    let mut filled = 0;
    while filled < bytes.len() {
        match reader.read(&mut bytes[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUND: Bound = Bound { bytes: 4, kind: "a test", remedy: "write a shorter one" };

    #[test]
    fn what_never_ends_is_refused_with_bound_and_remedy() {
        let error = bytes_of(std::io::repeat(7), "endless", BOUND).unwrap_err().to_string();
        assert_eq!(error, "endless: longer than 4 bytes, the most that a test may have; write a shorter one");
        assert_eq!(bytes_of(&b"1234"[..], "fits", BOUND).unwrap(), b"1234");
    }

    /// As much as the TOML parser takes for dotted keys: 38 MB for 5,000 lines of six dots. Dots of numbers
    /// and of names of files make no tables.
    #[test]
    fn dots_between_parts_of_keys_are_tables() {
        let line = "a.b.c.d.e.f.g = 1\n";
        let bytes = parsing_bytes(line.as_bytes());
        assert!((6.0 * DOTTED_BYTES..6.5 * DOTTED_BYTES).contains(&bytes), "{bytes}");
        for other in ["delay = 0.125\n", "image = \"a.b.png\"\n", "# a \" in a comment\n"] {
            assert!(parsing_bytes(other.as_bytes()) < 500.0, "{other}");
        }
    }

    #[test]
    fn what_is_no_text_says_where() {
        assert!(text_in(b"ab\xff".to_vec(), "x").unwrap_err().to_string().contains("byte 2"));
    }
}
