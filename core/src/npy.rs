//! The header of a NumPy array (.npy).
//!
//! Source: NumPy, *NEP 1: a simple file format for NumPy arrays*, versions 1 to 3.

use crate::messages::Quoted;
use std::io::{self, ErrorKind, Read};

/// The first bytes of every array.
pub const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest header; those of arrays of numbers have a hundred bytes.
const LONGEST_HEADER: usize = 1 << 16;

/// What the header of an array says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    /// The type of its numbers, such as `<f4`.
    pub descr: String,
    /// Numbers along the axes.
    pub shape: Vec<u64>,
    /// The first axis runs fastest, as in Fortran; otherwise the last one does.
    pub is_column_major: bool,
    /// Where the numbers begin.
    pub offset: u64,
}

impl NpyHeader {
    /// Reads the header, up to the first number of the array.
    ///
    /// ```
    /// use hybank_core::npy::NpyHeader;
    /// let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";
    /// let length = (text.len() as u16).to_le_bytes();
    /// let file = [b"\x93NUMPY\x01\x00", &length[..], text.as_bytes(), &[0; 24]].concat();
    /// let header = NpyHeader::read(&mut &file[..])?;
    /// assert_eq!((header.descr.as_str(), header.shape.as_slice()), ("<f4", &[2, 3][..]));
    /// assert_eq!(header.offset as usize, file.len() - 6 * 4);
    /// # Ok::<(), std::io::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`ErrorKind::InvalidData`] with the reason for other files.
    pub fn read(reader: &mut impl Read) -> io::Result<Self> {
        let mut start = [0; 8];
        exact(reader, &mut start)?;
        if !start.starts_with(MAGIC) {
            return Err(malformed("it does not begin with \\x93NUMPY; save it with numpy.save"));
        }
        let (version, size) = (start[6], if start[6] == 1 { 2 } else { 4 });
        let mut length = [0; 4];
        exact(reader, &mut length[..size])?;
        let length = u32::from_le_bytes(length) as usize;
        if !(1..=3).contains(&version) || length > LONGEST_HEADER {
            let problem =
                format!("version {version} with a header of {length} bytes is unknown; save it again");
            return Err(malformed(problem));
        }
        let mut text = vec![0; length];
        exact(reader, &mut text)?;
        Self::parse(&String::from_utf8_lossy(&text), (8 + size + length) as u64).map_err(malformed)
    }

    /// From the text of the header, a Python dictionary.
    fn parse(text: &str, offset: u64) -> Result<Self, String> {
        let is_column_major = match value(text, "fortran_order")? {
            order if order.starts_with("True") => true,
            order if order.starts_with("False") => false,
            _ => return Err("its 'fortran_order' is neither True nor False; save it with numpy.save".into()),
        };
        let descr = quoted(value(text, "descr")?).to_owned();
        Ok(Self { descr, shape: shape(value(text, "shape")?)?, is_column_major, offset })
    }
}

fn malformed(problem: impl Into<String>) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, problem.into())
}

fn exact(reader: &mut impl Read, bytes: &mut [u8]) -> io::Result<()> {
    reader.read_exact(bytes).map_err(|error| match error.kind() {
        ErrorKind::UnexpectedEof => malformed("it ends inside its header; copy it again"),
        _ => error,
    })
}

/// What follows a key of the dictionary.
fn value<'a>(text: &'a str, key: &str) -> Result<&'a str, String> {
    let missing = || format!("its header has no '{key}'; save it with numpy.save");
    let (_, rest) = text.split_once(&format!("'{key}'")).ok_or_else(missing)?;
    rest.trim_start().strip_prefix(':').map(str::trim_start).ok_or_else(missing)
}

/// The text in quotes at the beginning, or all of it.
fn quoted(text: &str) -> &str {
    text.strip_prefix('\'').and_then(|rest| rest.split('\'').next()).unwrap_or(text)
}

fn shape(text: &str) -> Result<Vec<u64>, String> {
    let inside = text.strip_prefix('(').and_then(|rest| rest.split_once(')')).map(|(inside, _)| inside);
    let sizes = inside.ok_or("its header has no shape; save it with numpy.save")?.split(',');
    let sizes = sizes.map(str::trim).filter(|size| !size.is_empty());
    let size = |size: &str| {
        size.parse().map_err(|_| format!("the size \"{}\" in its shape is no number", Quoted(size)))
    };
    sizes.map(size).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_header_is_refused() {
        for bytes in
            [&b"RIFFxxxx"[..], b"\x93NUM", b"\x93NUMPY\x01\x00\x40\x00{'descr'", b"\x93NUMPY\x09\x00\0\0\0\0"]
        {
            assert_eq!(NpyHeader::read(&mut { bytes }).unwrap_err().kind(), ErrorKind::InvalidData);
        }
    }
}
