//! Reads whole files up to a maximum size. A device, for example, never ends.

use super::FileError;
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
    Bound { bytes: 64 << 20, kind: "a spec or bank file", remedy: "give the file that was meant" };

/// The bytes of a file.
///
/// # Errors
/// The system's refusal, or [`FileError::TooLong`].
pub fn read_bytes(path: &Path, bound: Bound) -> Result<Vec<u8>, FileError> {
    let name = path.display().to_string();
    let file = File::open(path).map_err(FileError::system(&name, "read it"))?;
    bytes_of(file, &name, bound)
}

/// What some editors write before a text.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

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

/// The text that `bytes`, read from what is called `name`, hold; some editors mark its beginning.
///
/// # Errors
/// [`FileError::NotText`].
pub fn text_in(mut bytes: Vec<u8>, name: &str) -> Result<String, FileError> {
    if bytes.starts_with(BYTE_ORDER_MARK) {
        bytes.drain(..BYTE_ORDER_MARK.len());
    }
    String::from_utf8(bytes).map_err(|error| FileError::NotText {
        file: name.to_owned(),
        offset: error.utf8_error().valid_up_to(),
    })
}

/// Reads until `bytes` are full or the end; gives how many there are.
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

    #[test]
    fn what_is_no_text_says_where() {
        assert!(text_in(b"ab\xff".to_vec(), "x").unwrap_err().to_string().contains("byte 2"));
    }
}
