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

/// Bytes of memory that parsing takes for each byte of a text, and for what some of them begin or end.
/// Measured for texts of one kind each: strings, numbers, keys, lists, tables, comments. Of these the sum is
/// low by a quarter at most. It is high, up to five times, for tables without a key. The parser of TOML
/// allocates 7 bytes for each byte first, whatever the text is.
const JSON_BYTE: f64 = 4.0;
const TOML_BYTE: f64 = 8.0;

fn json_part(byte: u8) -> f64 {
    match byte {
        b',' => 60.0,
        b':' => 100.0,
        b'{' => 500.0,
        b'[' => 300.0,
        _ => 0.0,
    }
}

/// The parser of TOML makes tokens first, of comments and spaces too.
fn toml_part(before: u8, byte: u8, next: u8) -> f64 {
    match byte {
        b',' => 170.0,
        b'=' => 160.0,
        b'\n' => 50.0,
        b'#' => 30.0,
        b' ' | b'\t' if !matches!(next, b' ' | b'\t') => 100.0,
        b'{' => 1100.0,
        // The header of a table, or a list.
        b'[' if before == b'\n' => 1250.0,
        b'[' => 330.0,
        _ => 0.0,
    }
}

/// Of a dot between the parts of a key, `a.b`, each of which is a table.
const DOTTED_BYTES: f64 = 1150.0;

/// Bytes of memory that parsing a text takes, about: JSON if it begins as an object does, else TOML, whose
/// parser takes more than those of lines and tables do.
#[doc(hidden)]
pub fn parsing_bytes(text: &[u8]) -> f64 {
    if text.trim_ascii_start().starts_with(b"{") {
        return text.iter().map(|&byte| JSON_BYTE + json_part(byte)).sum();
    }
    let (mut is_quoted, mut is_number) = (false, true);
    let before = std::iter::once(&b'\n').chain(text);
    let following = text.iter().skip(1).chain(b"\n");
    let of = |((&before, &byte), &next): ((&u8, &u8), &u8)| {
        match byte {
            b'"' => is_quoted = !is_quoted,
            b'\n' => is_quoted = false,
            _ => {}
        }
        let is_key = byte == b'.' && !is_quoted && !(is_number && next.is_ascii_digit());
        is_number = match byte {
            b'.' => false,
            b'0'..=b'9' | b'_' | b'+' | b'-' => is_number,
            _ => !byte.is_ascii_alphabetic(),
        };
        TOML_BYTE + toml_part(before, byte, next) + if is_key { DOTTED_BYTES } else { 0.0 }
    };
    before.zip(text).zip(following).map(of).sum()
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

    /// Dots of numbers and of names of files make no tables.
    #[test]
    fn dots_between_parts_of_keys_are_tables() {
        for line in ["a.b.c.d.e.f.g = 1\n", "a.1.2.3.4.5.6 = 1\n"] {
            let bytes = parsing_bytes(line.as_bytes());
            assert!((6.0 * DOTTED_BYTES..6.5 * DOTTED_BYTES).contains(&bytes), "{line}: {bytes}");
        }
        for other in ["delay = 0.125\n", "image = \"a.b.png\"\n", " [1.5e-3, -2.25]\n", "x = +1.5\n"] {
            assert!(parsing_bytes(other.as_bytes()) < DOTTED_BYTES, "{other}");
        }
    }

    #[test]
    fn what_is_no_text_says_where() {
        assert!(text_in(b"ab\xff".to_vec(), "x").unwrap_err().to_string().contains("byte 2"));
    }
}
