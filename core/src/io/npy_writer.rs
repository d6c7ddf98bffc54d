//! Writes one channel of samples as a NumPy array (.npy).

use super::{OutputHeader, PcmFormat};
use crate::npy::MAGIC;
use std::io::{self, Seek, SeekFrom, Write};

/// Bytes before the first number: a multiple of 64, with room for any count.
const HEADER: usize = 128;

/// An array being written, of one axis.
#[derive(Debug)]
pub(super) struct NpyFile<W> {
    inner: W,
    descr: String,
    sample_bytes: usize,
    bytes: u64,
}

impl<W: Write + Seek> NpyFile<W> {
    /// Begins an array at the start of `inner`.
    ///
    /// # Errors
    /// `InvalidInput` for numbers that NumPy has no type for, or the writer's own.
    pub(super) fn new(mut inner: W, header: OutputHeader) -> io::Result<Self> {
        let OutputHeader { format, is_complex, .. } = header;
        let sample_bytes = format.bytes() * (1 + usize::from(is_complex));
        let descr = descr(format, is_complex).ok_or_else(|| {
            let what = if is_complex { "complex samples of " } else { "" };
            io::Error::new(
                io::ErrorKind::InvalidInput,
                format!("NumPy has no type for {what}{format}; write floats of 32 or 64 bits"),
            )
        })?;
        inner.write_all(&[0; HEADER])?;
        Ok(Self { inner, descr, sample_bytes, bytes: 0 })
    }

    /// What it is written to.
    pub(super) fn inner_mut(&mut self) -> &mut W {
        &mut self.inner
    }

    /// Appends encoded samples.
    ///
    /// # Errors
    /// The writer's.
    pub(super) fn write_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.write_all(bytes)?;
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    /// Writes the header, now that the count is known, and gives the writer back.
    ///
    /// # Errors
    /// The writer's.
    pub(super) fn finish(mut self) -> io::Result<W> {
        let count = self.bytes / self.sample_bytes as u64;
        let text = format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({count},), }}", self.descr);
        let length = HEADER - MAGIC.len() - 4;
        let mut header = [MAGIC, &[1, 0], &(length as u16).to_le_bytes(), text.as_bytes()].concat();
        header.resize(HEADER - 1, b' ');
        header.push(b'\n');
        self.inner.seek(SeekFrom::Start(0))?;
        self.inner.write_all(&header)?;
        self.inner.flush()?;
        Ok(self.inner)
    }
}

/// NumPy's name of a type.
fn descr(format: PcmFormat, is_complex: bool) -> Option<String> {
    let bytes = format.bytes();
    let kind = match (format.is_float(), format.is_unsigned()) {
        (true, _) => 'f',
        (false, true) => 'u',
        (false, false) => 'i',
    };
    let order = match bytes {
        1 => '|',
        _ if format.name().ends_with("be") => '>',
        _ => '<',
    };
    match is_complex {
        _ if bytes == 3 => None,
        true if kind == 'f' && bytes >= 4 => Some(format!("{order}c{}", 2 * bytes)),
        true => None,
        false => Some(format!("{order}{kind}{bytes}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::{Container, npy_header};
    use std::io::Cursor;

    fn written(format: PcmFormat, is_complex: bool, bytes: &[u8]) -> io::Result<Vec<u8>> {
        let header = OutputHeader { container: Container::Npy, format, is_complex, rate: 1.0 };
        let mut file = NpyFile::new(Cursor::new(Vec::new()), header)?;
        file.write_bytes(bytes)?;
        Ok(file.finish()?.into_inner())
    }

    #[test]
    fn arrays_read_back_with_their_type_and_count() {
        for format in PcmFormat::ALL.into_iter().filter(|format| format.bytes() != 3) {
            let bytes = vec![1; 5 * format.bytes()];
            let file = written(format, false, &bytes).unwrap();
            let header = npy_header(&mut &file[..], "x.npy").unwrap();
            assert_eq!((header.format, header.shape, header.offset), (format, vec![5], HEADER as u64));
            assert_eq!(file[HEADER..], bytes);
        }
        let file = written(PcmFormat::F32Le, true, &[0; 24]).unwrap();
        let header = npy_header(&mut &file[..], "x.npy").unwrap();
        assert!(header.is_complex && header.shape == [3]);
        for (format, is_complex) in [(PcmFormat::S24Le, false), (PcmFormat::S16Le, true)] {
            assert!(written(format, is_complex, &[]).unwrap_err().to_string().contains("NumPy has no type"));
        }
    }
}
