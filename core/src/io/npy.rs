//! Captures in NumPy arrays (.npy). Integers have the full scale 1.0, as in every other format of captures.

use super::array::{ArrayHeader, ArrayReader};
use super::{IoError, PcmFormat};
use crate::messages::Quoted;
use crate::npy::NpyHeader;
use std::io::{ErrorKind, Read, Seek};

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
/// # Errors
/// [`IoError::Malformed`] for other files and for arrays of anything but numbers.
pub fn npy_header(reader: &mut impl Read, file: &str) -> Result<ArrayHeader, IoError> {
    let fault = || IoError::malformed(file, KIND);
    let header = NpyHeader::read(reader).map_err(|error| match error.kind() {
        ErrorKind::InvalidData => fault()(error.to_string()),
        _ => IoError::system(file, "read the header")(error),
    })?;
    // Complex numbers of 8 bytes are two of 4.
    let parts = [("<c8", "<f4"), (">c8", ">f4"), ("<c16", "<f8"), (">c16", ">f8")];
    let part = parts.iter().find(|(complex, _)| *complex == header.descr).map(|(_, part)| *part);
    let format = format(part.unwrap_or(&header.descr)).map_err(fault())?;
    let NpyHeader { shape, is_column_major, offset, .. } = header;
    Ok(ArrayHeader { format, is_complex: part.is_some(), shape, is_column_major, offset })
}

fn format(descr: &str) -> Result<PcmFormat, String> {
    use PcmFormat::{
        F16Be, F16Le, F32Be, F32Le, F64Be, F64Le, S8, S16Be, S16Le, S32Be, S32Le, S64Be, S64Le, U8, U16Be,
        U16Le, U32Be, U32Le,
    };
    match descr {
        "|i1" => Ok(S8),
        "|u1" => Ok(U8),
        "<i2" => Ok(S16Le),
        ">i2" => Ok(S16Be),
        "<i4" => Ok(S32Le),
        ">i4" => Ok(S32Be),
        "<u2" => Ok(U16Le),
        ">u2" => Ok(U16Be),
        "<u4" => Ok(U32Le),
        ">u4" => Ok(U32Be),
        "<i8" => Ok(S64Le),
        ">i8" => Ok(S64Be),
        "<f2" => Ok(F16Le),
        ">f2" => Ok(F16Be),
        "<f4" => Ok(F32Le),
        ">f4" => Ok(F32Be),
        "<f8" => Ok(F64Le),
        ">f8" => Ok(F64Be),
        "|b1" => {
            Err("it is logical: true and false are no samples; save what they mean as numbers".to_owned())
        }
        other => Err(format!(
            "its numbers are {}; save i1 to i8, u1 to u4, f2 to f8, c8 or c16, for example with x.astype(\"f4\")",
            Quoted(other)
        )),
    }
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
            ("<u8", "(9,)", "its numbers are <u8"),
            ("|b1", "(9,)", "it is logical"),
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
    }
}
