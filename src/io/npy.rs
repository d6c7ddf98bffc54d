//! NumPy arrays (.npy): captures, and the header of any other.
//!
//! Source: NumPy, *NEP 1: a simple file format for NumPy arrays*, versions 1 to 3. Integers have the full
//! scale 1.0, as in every other format of captures.

use super::array::{ArrayHeader, ArrayReader};
use super::{IoError, PcmFormat};
use crate::messages::Quoted;
use std::io::{self, Read, Seek};

/// Longest header; those of arrays of numbers have a hundred bytes.
const LONGEST_HEADER: usize = 1 << 16;

const KIND: &str = "a NumPy array of samples";

/// Opens an array of samples called `file`. The rate is not in it.
///
/// # Errors
/// [`IoError::Malformed`] for other files and for arrays that are no captures.
pub(super) fn open_npy<R: Read + Seek>(mut reader: R, file: &str) -> Result<ArrayReader<R>, IoError> {
    let header = npy_header(&mut reader, file)?;
    ArrayReader::new(header, reader, None, IoError::malformed(file, KIND))
}

/// Reads the header of an array called `file`, up to its first number.
///
/// ```
/// use hybank::io::{PcmFormat, npy_header};
/// let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";
/// let length = (text.len() as u16).to_le_bytes();
/// let file = [b"\x93NUMPY\x01\x00", &length[..], text.as_bytes(), &[0; 24]].concat();
/// let header = npy_header(&mut &file[..], "x.npy")?;
/// assert_eq!((header.format, header.shape.as_slice()), (PcmFormat::F32Le, &[2, 3][..]));
/// assert_eq!(header.offset as usize, file.len() - 6 * header.sample_bytes());
/// # Ok::<(), hybank::io::IoError>(())
/// ```
///
/// # Errors
/// [`IoError::Malformed`] for other files and for arrays of anything but numbers.
pub fn npy_header(reader: &mut impl Read, file: &str) -> Result<ArrayHeader, IoError> {
    let fault = || IoError::malformed(file, KIND);
    let mut exact = |bytes: &mut [u8]| {
        reader.read_exact(bytes).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => fault()("it ends inside its header; copy it again".into()),
            _ => IoError::system(file, "read the header")(error),
        })
    };
    let mut start = [0; 8];
    exact(&mut start)?;
    if start[..6] != *b"\x93NUMPY" {
        return Err(fault()("it does not begin with \\x93NUMPY; save it with numpy.save".into()));
    }
    let (version, size) = (start[6], if start[6] == 1 { 2 } else { 4 });
    let mut length = [0; 4];
    exact(&mut length[..size])?;
    let length = u32::from_le_bytes(length) as usize;
    if !(1..=3).contains(&version) || length > LONGEST_HEADER {
        return Err(fault()(format!(
            "version {version} with a header of {length} bytes is unknown; save it again"
        )));
    }
    let mut text = vec![0; length];
    exact(&mut text)?;
    parse(&String::from_utf8_lossy(&text), (8 + size + length) as u64).map_err(fault())
}

/// From the text of the header, a Python dictionary.
fn parse(text: &str, offset: u64) -> Result<ArrayHeader, String> {
    let descr = quoted(value(text, "descr")?);
    // Complex numbers of 8 bytes are two of 4.
    let parts = [("<c8", "<f4"), (">c8", ">f4"), ("<c16", "<f8"), (">c16", ">f8")];
    let part = parts.iter().find(|(complex, _)| *complex == descr).map(|(_, part)| *part);
    let is_column_major = match value(text, "fortran_order")? {
        order if order.starts_with("True") => true,
        order if order.starts_with("False") => false,
        _ => return Err("its 'fortran_order' is neither True nor False; save it with numpy.save".to_owned()),
    };
    let (format, is_complex) = (format(part.unwrap_or(descr))?, part.is_some());
    Ok(ArrayHeader { format, is_complex, shape: shape(value(text, "shape")?)?, is_column_major, offset })
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

fn format(descr: &str) -> Result<PcmFormat, String> {
    use PcmFormat::{F32Be, F32Le, F64Be, F64Le, S8, S16Be, S16Le, S32Be, S32Le, U8};
    match descr {
        "|i1" => Ok(S8),
        "|u1" => Ok(U8),
        "<i2" => Ok(S16Le),
        ">i2" => Ok(S16Be),
        "<i4" => Ok(S32Le),
        ">i4" => Ok(S32Be),
        "<f4" => Ok(F32Le),
        ">f4" => Ok(F32Be),
        "<f8" => Ok(F64Le),
        ">f8" => Ok(F64Be),
        other => Err(format!(
            "its numbers are {}; save i1, u1, i2, i4, f4, f8, c8 or c16, for example with x.astype(\"f4\")",
            Quoted(other)
        )),
    }
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
    use std::io::Cursor;

    fn open(descr: &str, fortran: &str, shape: &str) -> Result<ArrayReader<Cursor<Vec<u8>>>, String> {
        let text = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}  \n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        // As many numbers as the small shapes need.
        bytes.resize(bytes.len() + 100, 0);
        open_npy(Cursor::new(bytes), "x.npy").map_err(|error| error.to_string())
    }

    #[test]
    fn the_shorter_axis_holds_the_channels() {
        for (fortran, shape, channels, frames, is_planar) in [
            ("False", "(9,)", 1, 9, false),
            ("False", "(2, 9)", 2, 9, true),
            ("False", "(9, 2)", 2, 9, false),
            ("True", "(2, 9)", 2, 9, false),
            ("True", "(9, 2)", 2, 9, true),
            ("False", "(3, 3)", 3, 3, true),
            ("False", "(1, 5)", 1, 5, false),
            ("False", "(5, 1)", 1, 5, false),
        ] {
            let found = open("<f4", fortran, shape).unwrap();
            let header = found.header();
            assert_eq!(
                (header.channels, header.promised, found.is_planar),
                (channels, Some(frames), is_planar),
                "{shape}"
            );
        }
    }

    #[test]
    fn what_is_no_capture_is_refused_with_the_reason() {
        for (descr, shape, part) in [
            ("<i8", "(9,)", "its numbers are <i8"),
            ("<f4", "(2, 3, 4)", "3 axes"),
            ("<f4", "()", "0 axes"),
            ("<f4", "(0, 7)", "0 channels"),
            ("<f4", "(2, 18446744073709551615)", "more numbers than any disk"),
            ("<f4", "(2, 99999999999999999999)", "no number"),
            ("<f4", "7", "no shape"),
        ] {
            let message = open(descr, "False", shape).unwrap_err();
            assert!(message.starts_with("x.npy: not a NumPy array") && message.contains(part), "{message}");
        }
        let garbage = open("<f4", "maybe", "(2, 9)").unwrap_err();
        assert!(garbage.contains("neither True nor False"), "{garbage}");
        for bytes in
            [&b"RIFFxxxx"[..], b"\x93NUM", b"\x93NUMPY\x01\x00\x40\x00{'descr'", b"\x93NUMPY\x09\x00\0\0\0\0"]
        {
            assert!(npy_header(&mut { bytes }, "x.npy").is_err());
        }
    }
}
