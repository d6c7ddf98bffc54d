//! Captures as NumPy arrays (.npy).
//!
//! Source: NumPy, *NEP 1: a simple file format for NumPy arrays*, versions 1 to 3. Of two axes the shorter
//! one holds the channels, and the rows do if both are equal: `(N, T)` as the Python package has it,
//! `(T, N)` as sound files have it. Integers have the full scale 1.0, as in every other format.

use super::{IoError, PcmFormat, SampleLayout, StreamHeader};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// Longest header; those of arrays of numbers have a hundred bytes.
const LONGEST_HEADER: usize = 1 << 16;
/// Maximum number of channels, the same as in a WAV header.
const MOST_CHANNELS: u64 = 65_535;
/// Bytes of all channels together that are read at a time, where each channel lies by itself.
const PLANAR_BYTES: usize = 1 << 20;

/// What the header of an array says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    /// Sample format of one number.
    pub format: PcmFormat,
    /// Each sample is two numbers.
    pub is_complex: bool,
    /// Channels.
    pub channels: usize,
    /// Samples of each channel.
    pub frames: u64,
    /// The samples of a channel follow each other; otherwise those of a frame do.
    pub is_planar: bool,
    /// Where the numbers begin.
    pub offset: u64,
}

impl NpyHeader {
    /// Reads the header of an array called `file`.
    ///
    /// # Errors
    /// [`IoError::Malformed`] for other files and for arrays that are no captures.
    pub fn read(reader: &mut impl Read, file: &str) -> Result<Self, IoError> {
        let fault = |problem: String| malformed(file, problem);
        let mut start = [0; 8];
        exact(reader, &mut start, file)?;
        if start[..6] != *b"\x93NUMPY" {
            return Err(fault("it does not begin with \\x93NUMPY; save it with numpy.save".into()));
        }
        let size = if start[6] == 1 { 2 } else { 4 };
        let mut length = [0; 4];
        exact(reader, &mut length[..size], file)?;
        let length = u32::from_le_bytes(length) as usize;
        if !(1..=3).contains(&start[6]) || length > LONGEST_HEADER {
            let version = start[6];
            return Err(fault(format!(
                "version {version} with a header of {length} bytes is unknown; save it again"
            )));
        }
        let mut text = vec![0; length];
        exact(reader, &mut text, file)?;
        let offset = (8 + size + length) as u64;
        Self::parse(&String::from_utf8_lossy(&text), offset).map_err(fault)
    }

    /// From the text of the header, a Python dictionary.
    fn parse(text: &str, offset: u64) -> Result<Self, String> {
        let descr = quoted(value(text, "descr")?);
        // Complex numbers of 8 bytes are two of 4.
        let parts = [("<c8", "<f4"), (">c8", ">f4"), ("<c16", "<f8"), (">c16", ">f8")];
        let part = parts.iter().find(|(complex, _)| *complex == descr).map(|(_, part)| *part);
        let (format, is_complex) = (format(part.unwrap_or(descr))?, part.is_some());
        let is_fortran = value(text, "fortran_order")?.starts_with("True");
        let shape = shape(value(text, "shape")?)?;
        let (rows, columns) = match shape[..] {
            [samples] => (1, samples),
            [rows, columns] => (rows, columns),
            _ => {
                return Err(format!(
                    "it has {} axes; give (samples), (channels, samples) or (samples, channels)",
                    shape.len()
                ));
            }
        };
        let rows_are_channels = rows <= columns;
        let (channels, frames) = if rows_are_channels { (rows, columns) } else { (columns, rows) };
        if !(1..=MOST_CHANNELS).contains(&channels) {
            return Err(format!(
                "the shape {shape:?} has {channels} channels; it may be 1 to {MOST_CHANNELS}"
            ));
        }
        if frames.checked_mul(channels * 2 * format.bytes() as u64).is_none_or(|bytes| bytes > 1 << 62) {
            return Err(format!("the shape {shape:?} has more numbers than any disk; the file is damaged"));
        }
        let channels = channels as usize;
        let is_planar = channels > 1 && rows_are_channels != is_fortran;
        Ok(Self { format, is_complex, channels, frames, is_planar, offset })
    }

    /// As the header of an input. The rate is not in the file.
    pub fn stream_header(&self) -> StreamHeader {
        let real = StreamHeader::real(SampleLayout::packed(self.format), self.channels);
        StreamHeader { is_complex: self.is_complex, promised: Some(self.frames), ..real }
    }

    /// Bytes of all numbers.
    pub fn data_bytes(&self) -> u64 {
        self.frames * (self.channels * self.sample_bytes()) as u64
    }

    fn sample_bytes(&self) -> usize {
        if self.is_complex { 2 * self.format.bytes() } else { self.format.bytes() }
    }
}

fn malformed(file: &str, problem: String) -> IoError {
    IoError::Malformed { file: file.to_owned(), kind: "a NumPy array of samples", problem }
}

fn exact(reader: &mut impl Read, bytes: &mut [u8], file: &str) -> Result<(), IoError> {
    reader.read_exact(bytes).map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => malformed(file, "it ends inside its header; copy it again".into()),
        _ => IoError::system(file, "read the header")(error),
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
        other => {
            let shown: String = other.chars().take(20).collect();
            Err(format!(
                "its numbers are {shown}; save i1, u1, i2, i4, f4, f8, c8 or c16, for example with x.astype(\"f4\")"
            ))
        }
    }
}

fn shape(text: &str) -> Result<Vec<u64>, String> {
    let inside = text.strip_prefix('(').and_then(|rest| rest.split_once(')')).map(|(inside, _)| inside);
    let sizes = inside.ok_or("its header has no shape; save it with numpy.save")?.split(',');
    let sizes = sizes.map(str::trim).filter(|size| !size.is_empty());
    let size =
        |size: &str| size.parse().map_err(|_| format!("the size \"{size}\" in its shape is no number"));
    sizes.map(size).collect()
}

/// Frames of an array in which each channel lies by itself, from a file.
#[derive(Debug)]
pub(super) struct PlanarReader {
    file: File,
    header: NpyHeader,
    /// The next frame to read.
    next: u64,
    /// Whole frames, and how much of them has been given.
    frames: Vec<u8>,
    given: usize,
}

impl PlanarReader {
    /// The numbers after the header of `file`, which must have them all.
    pub(super) fn new(file: File, header: NpyHeader, name: &str) -> Result<Self, IoError> {
        let known = file.metadata().map_err(IoError::system(name, "read its size"))?;
        let wanted = header.offset + header.data_bytes();
        if !known.is_file() {
            let problem =
                "its channels follow each other, which a pipe cannot give; save the transposed array";
            return Err(malformed(name, problem.into()));
        }
        if known.len() < wanted {
            let problem =
                format!("its shape needs {wanted} bytes, but there are {}; copy it again", known.len());
            return Err(malformed(name, problem));
        }
        Ok(Self { file, header, next: 0, frames: Vec::new(), given: 0 })
    }

    /// Reads the next frames of all channels.
    fn refill(&mut self) -> io::Result<()> {
        let NpyHeader { channels, frames, offset, .. } = self.header;
        let size = self.header.sample_bytes();
        let most = (PLANAR_BYTES / (channels * size)).max(1) as u64;
        let count = (frames - self.next).min(most) as usize;
        let mut samples = vec![0; count * size];
        self.frames.resize(count * channels * size, 0);
        self.given = 0;
        for channel in 0..channels {
            let first = offset + (channel as u64 * frames + self.next) * size as u64;
            self.file.seek(SeekFrom::Start(first))?;
            self.file.read_exact(&mut samples)?;
            let slots = self.frames.chunks_exact_mut(channels * size);
            for (frame, sample) in slots.zip(samples.chunks_exact(size)) {
                frame[channel * size..][..size].copy_from_slice(sample);
            }
        }
        self.next += count as u64;
        Ok(())
    }
}

impl Read for PlanarReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.given == self.frames.len() {
            self.refill()?;
        }
        let count = bytes.len().min(self.frames.len() - self.given);
        bytes[..count].copy_from_slice(&self.frames[self.given..][..count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(descr: &str, fortran: &str, shape: &str) -> Result<NpyHeader, String> {
        let text = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}  \n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        NpyHeader::read(&mut &bytes[..], "x.npy").map_err(|error| error.to_string())
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
            let found = header("<f4", fortran, shape).unwrap();
            assert_eq!(
                (found.channels, found.frames, found.is_planar),
                (channels, frames, is_planar),
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
            let message = header(descr, "False", shape).unwrap_err();
            assert!(message.starts_with("x.npy: not a NumPy array") && message.contains(part), "{message}");
        }
        for bytes in
            [&b"RIFFxxxx"[..], b"\x93NUM", b"\x93NUMPY\x01\x00\x40\x00{'descr'", b"\x93NUMPY\x09\x00\0\0\0\0"]
        {
            assert!(NpyHeader::read(&mut { bytes }, "x.npy").is_err());
        }
    }
}
