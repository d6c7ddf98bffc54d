//! Refuses a WAV header where raw samples are expected.

use super::IoError;
use std::io::{self, Read};

/// Raw bytes. A WAV header at the beginning is an error: raw samples look like one by chance in one of 2^64
/// cases.
#[derive(Debug)]
pub(super) struct NotWav<R> {
    inner: R,
    /// For messages.
    file: String,
    is_first: bool,
}

impl<R> NotWav<R> {
    /// The bytes of an input called `file`.
    pub(super) fn new(inner: R, file: &str) -> Self {
        Self { inner, file: file.to_owned(), is_first: true }
    }
}

impl<R: Read> Read for NotWav<R> {
    /// Looks at the first bytes that come: a header in pieces is not found.
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(bytes)?;
        if std::mem::take(&mut self.is_first) && is_wav(&bytes[..count]) {
            return Err(io::Error::other(IoError::WavAmongRaw { file: self.file.clone() }));
        }
        Ok(count)
    }
}

fn is_wav(bytes: &[u8]) -> bool {
    matches!(bytes, [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'A', b'V', b'E', ..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_header_at_the_beginning_is_refused() {
        let header = b"RIFF\x24\0\0\0WAVEfmt ";
        let read = |bytes: &[u8]| io::copy(&mut NotWav::new(bytes, "x"), &mut io::sink());
        let error = read(header).unwrap_err().to_string();
        assert!(error.contains("x: it begins with a WAV header"), "{error}");
        assert_eq!(read(&header[1..]).unwrap(), 15);
        let later = [&b"0123"[..], header].concat();
        assert_eq!(read(&later).unwrap(), 20);
    }
}
