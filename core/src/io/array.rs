//! Captures as arrays of numbers, NumPy's and MATLAB's. Of two axes the shorter one holds the channels, and
//! the rows do if both are equal: `(N, T)` as the Python package has it, `(T, N)` as sound files have it.

use super::capture::{Blocks, ByteSource};
use super::stream_header::MOST_CHANNELS;
use super::{IoError, PcmFormat, SampleLayout, StreamHeader};
use crate::messages::Quoted;
use std::io::{self, Read, Seek, SeekFrom, Take};

/// No disk holds as many bytes: a shape that needs them is damaged, and the products below cannot overflow.
const MOST_BYTES: u64 = 1 << 62;
/// Bytes of all channels together that are read at a time, where each channel lies by itself.
const PLANAR_BYTES: usize = 1 << 20;

/// How the numbers of an array are stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArrayHeader {
    /// Format of one number.
    pub format: PcmFormat,
    /// Each sample is two numbers.
    pub is_complex: bool,
    /// Numbers of samples along the axes.
    pub shape: Vec<u64>,
    /// The first axis runs fastest, as in MATLAB and Fortran; otherwise the last one does.
    pub is_column_major: bool,
    /// Where the numbers begin.
    pub offset: u64,
}

impl ArrayHeader {
    /// Bytes of a sample.
    pub fn sample_bytes(&self) -> usize {
        if self.is_complex { 2 * self.format.bytes() } else { self.format.bytes() }
    }

    /// Channels, and samples of each.
    fn channels_and_frames(&self) -> Result<(u64, u64), String> {
        let shape = &self.shape;
        let (rows, columns) = self.rows_and_columns().ok_or_else(|| {
            format!(
                "it has {} axes, of the shape {}; give (samples), (channels, samples) or (samples, channels)",
                shape.len(),
                self.shape_text()
            )
        })?;
        let (channels, frames) = (rows.min(columns), rows.max(columns));
        if !(1..=MOST_CHANNELS).contains(&channels) {
            return Err(format!(
                "the shape {} has {channels} channels; it may be 1 to {MOST_CHANNELS}",
                self.shape_text()
            ));
        }
        let bytes = frames.checked_mul(channels * self.sample_bytes() as u64);
        if bytes.is_none_or(|bytes| bytes > MOST_BYTES) {
            return Err(format!(
                "the shape {} has more numbers than any disk; the file is damaged",
                self.shape_text()
            ));
        }
        Ok((channels, frames))
    }

    /// A shape may have any number of axes.
    fn shape_text(&self) -> String {
        Quoted(format!("{:?}", self.shape)).to_string()
    }

    /// Further axes have one element.
    fn rows_and_columns(&self) -> Option<(u64, u64)> {
        match self.shape[..] {
            [samples] => Some((1, samples)),
            [rows, columns, ref more @ ..] if more.iter().all(|&size| size == 1) => Some((rows, columns)),
            _ => None,
        }
    }
}

/// Reads the frames of an array, channels interleaved.
#[derive(Debug)]
pub struct ArrayReader<R> {
    array: ArrayHeader,
    header: StreamHeader,
    /// The samples of a channel follow each other; otherwise those of a frame do.
    pub(super) is_planar: bool,
    numbers: Take<R>,
    /// The next frame to read, if each channel lies by itself.
    next: u64,
    blocks: Blocks,
}

impl<R: Read + Seek> ArrayReader<R> {
    /// The frames of `array`, whose numbers come next in `numbers`. `rate` is the number of frames per
    /// second, if it is known; `malformed` makes the error of a problem.
    ///
    /// # Errors
    /// [`IoError::Malformed`] for arrays that are no captures, and for planar ones that are cut.
    pub(super) fn new(
        array: ArrayHeader,
        numbers: R,
        rate: Option<f64>,
        malformed: impl FnOnce(String) -> IoError,
    ) -> Result<Self, IoError> {
        let (channels, frames) = match array.channels_and_frames() {
            Ok(found) => found,
            Err(problem) => return Err(malformed(problem)),
        };
        let bytes = frames * channels * array.sample_bytes() as u64;
        let rows_are_channels = array.rows_and_columns().is_some_and(|(rows, columns)| rows <= columns);
        let is_planar = channels > 1 && rows_are_channels != array.is_column_major;
        let real = StreamHeader::real(SampleLayout::packed(array.format), channels as usize);
        let header = StreamHeader { is_complex: array.is_complex, rate, promised: Some(frames), ..real };
        let mut numbers = numbers.take(bytes);
        if is_planar && let Err(problem) = check_length(numbers.get_mut(), array.offset + bytes) {
            return Err(malformed(problem));
        }
        Ok(Self { array, header, is_planar, numbers, next: 0, blocks: Blocks::default() })
    }
}

impl<R> ArrayReader<R> {
    /// As the header of an input.
    pub fn header(&self) -> StreamHeader {
        self.header
    }
}

/// Refuses what ends before `wanted` bytes, and what has no end.
fn check_length(file: &mut impl Seek, wanted: u64) -> Result<(), String> {
    match file.seek(SeekFrom::End(0)) {
        Ok(length) if length >= wanted => Ok(()),
        Ok(length) => Err(format!("its shape needs {wanted} bytes, but there are {length}; copy it again")),
        Err(_) => {
            Err("its channels follow each other, which a pipe cannot give; save the transposed array"
                .to_owned())
        }
    }
}

impl<R: Read + Seek> ByteSource for ArrayReader<R> {
    fn stream_header(&self) -> StreamHeader {
        self.header
    }

    fn missing_bytes(&self) -> u64 {
        if self.is_planar { 0 } else { self.numbers.limit() }
    }
}

impl<R: Read + Seek> Read for ArrayReader<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if !self.is_planar {
            return self.numbers.read(bytes);
        }
        let Self { array, header, numbers, next, blocks, .. } = self;
        let (size, channels) = (array.sample_bytes(), header.channels);
        let frames = header.promised.unwrap_or(0);
        blocks.read(bytes, |block| {
            let count = (frames - *next).min((PLANAR_BYTES / (channels * size)).max(1) as u64) as usize;
            let mut samples = vec![0; count * size];
            block.resize(count * channels * size, 0);
            for channel in 0..channels {
                let first = array.offset + (channel as u64 * frames + *next) * size as u64;
                let file = numbers.get_mut();
                let read = file.seek(SeekFrom::Start(first)).and_then(|_| file.read_exact(&mut samples));
                read?;
                let slots = block.chunks_exact_mut(channels * size);
                for (frame, sample) in slots.zip(samples.chunks_exact(size)) {
                    frame[channel * size..][..size].copy_from_slice(sample);
                }
            }
            *next += count as u64;
            io::Result::Ok(())
        })
    }
}
