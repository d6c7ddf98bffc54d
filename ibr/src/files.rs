//! Reading whole files up to a size limit, since a device may never end.

use std::fs::File;
use std::io::{Error, Read};
use std::path::Path;

/// Most bytes of an image or map.
const MOST_BYTES: u64 = 1 << 30;
/// Most bytes of a text file.
const MOST_TEXT: u64 = 1 << 28;

/// The bytes of a file.
///
/// # Errors
/// The system's reason, or that the file is larger than 1 GiB.
pub(crate) fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    at_most(File::open(path)?, MOST_BYTES)
}

/// The text of a file.
///
/// # Errors
/// The system's reason, that the file is larger than 256 MiB, or that it is not UTF-8.
pub(crate) fn read_text(path: &Path) -> std::io::Result<String> {
    text(File::open(path)?)
}

/// The text of a stream, as [`read_text`].
///
/// # Errors
/// As [`read_text`].
pub(crate) fn text(stream: impl Read) -> std::io::Result<String> {
    let bytes = at_most(stream, MOST_TEXT)?;
    String::from_utf8(bytes).map_err(|e| {
        let offset = e.utf8_error().valid_up_to();
        Error::other(format!("it is not a text file: byte {offset} is not UTF-8"))
    })
}

fn at_most(stream: impl Read, most: u64) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    stream.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(Error::other(format!("it has more than {} MiB", most >> 20)));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_never_ends_is_refused() {
        let message = at_most(std::io::repeat(7), 1 << 20).unwrap_err().to_string();
        assert_eq!(message, "it has more than 1 MiB");
        assert_eq!(at_most(&b"1234"[..], 4).unwrap(), b"1234");
    }

    #[test]
    fn what_is_no_text_says_where() {
        assert_eq!(text(&b"abc"[..]).unwrap(), "abc");
        assert!(text(&b"ab\xff"[..]).unwrap_err().to_string().contains("byte 2"));
    }
}
