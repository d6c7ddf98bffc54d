//! Writes WAV files: RIFF, or RF64 if the samples exceed 32-bit sizes.
//!
//! A file is begun as RIFF with a JUNK chunk where RF64's ds64 chunk would be; closing it writes
//! either the two 32-bit sizes or, past 4 GiB, turns it into RF64 in place (EBU Tech 3306).

use super::header::WavChunk;
use crate::io::PcmFormat;
use std::io::{self, Seek, SeekFrom, Write};

/// Content of a ds64 chunk: two sizes, the frame count and an empty table.
const DS64_BYTES: u32 = 28;
const DS64_OFFSET: u64 = 12;

/// The sample format, which determines the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Shape {
    format: PcmFormat,
    channels: u16,
    rate: u32,
}

impl Shape {
    /// WAV is little endian with unsigned bytes.
    fn new(format: PcmFormat, channels: u16, rate: u32) -> io::Result<Self> {
        use PcmFormat::{F32Le, F64Le, S16Le, S24Le, S32Le, U8};
        if !matches!(format, U8 | S16Le | S24Le | S32Le | F32Le | F64Le) {
            let message = format!("WAV cannot hold {format}; use u8, s16le, s24le, s32le, f32le or f64le");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
        }
        Ok(Self { format, channels, rate })
    }

    fn frame_bytes(self) -> u64 {
        self.format.bytes() as u64 * u64::from(self.channels)
    }

    /// More than two channels or more than 16 bits of integers ask for the extensible form.
    fn is_extensible(self) -> bool {
        self.channels > 2 || (!self.format.is_float() && self.format.bytes() > 2)
    }

    fn fmt_chunk(self) -> Vec<u8> {
        let tag: u16 = if self.format.is_float() { 3 } else { 1 };
        let bits = 8 * self.format.bytes() as u16;
        let extensible = self.is_extensible();
        let mut chunk = b"fmt ".to_vec();
        chunk.extend(if extensible { 40u32 } else { 16 }.to_le_bytes());
        chunk.extend(if extensible { 0xFFFE } else { tag }.to_le_bytes());
        chunk.extend(self.channels.to_le_bytes());
        chunk.extend(self.rate.to_le_bytes());
        chunk.extend(self.rate.saturating_mul(self.frame_bytes() as u32).to_le_bytes());
        chunk.extend((self.frame_bytes() as u16).to_le_bytes());
        chunk.extend(bits.to_le_bytes());
        if extensible {
            chunk.extend(22u16.to_le_bytes());
            chunk.extend(bits.to_le_bytes());
            // No speaker positions: the channels are converters, not loudspeakers.
            chunk.extend(0u32.to_le_bytes());
            chunk.extend(tag.to_le_bytes());
            chunk.extend([0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xAA, 0, 0x38, 0x9B, 0x71]);
        }
        chunk
    }
}

/// The header of a stream of unknown length: sizes 0xFFFFFFFF, which readers of streams take as "until the
/// end".
///
/// # Errors
/// `InvalidInput` if WAV has no such sample format.
pub fn stream_header(format: PcmFormat, channels: u16, rate: u32) -> io::Result<Vec<u8>> {
    let shape = Shape::new(format, channels, rate)?;
    let mut header = b"RIFF\xFF\xFF\xFF\xFFWAVE".to_vec();
    header.extend(shape.fmt_chunk());
    header.extend(b"data\xFF\xFF\xFF\xFF");
    Ok(header)
}

/// A WAV file being written.
#[derive(Debug)]
pub struct WavFile<W> {
    inner: W,
    shape: Shape,
    header_bytes: u64,
    data_bytes: u64,
}

impl<W: Write + Seek> WavFile<W> {
    /// Begins a file at the start of `inner`.
    ///
    /// # Errors
    /// `InvalidInput` if WAV has no such sample format, or the writer's own.
    pub fn new(mut inner: W, format: PcmFormat, channels: u16, rate: u32) -> io::Result<Self> {
        let shape = Shape::new(format, channels, rate)?;
        let mut header = b"RIFF\0\0\0\0WAVEJUNK".to_vec();
        header.extend(DS64_BYTES.to_le_bytes());
        header.extend([0; DS64_BYTES as usize]);
        header.extend(shape.fmt_chunk());
        header.extend(b"data\0\0\0\0");
        inner.write_all(&header)?;
        Ok(Self { inner, shape, header_bytes: header.len() as u64, data_bytes: 0 })
    }

    /// Appends encoded samples.
    ///
    /// # Errors
    /// The writer's.
    pub fn write_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.write_all(bytes)?;
        self.data_bytes += bytes.len() as u64;
        Ok(())
    }

    /// Bytes of samples so far.
    pub fn data_bytes(&self) -> u64 {
        self.data_bytes
    }

    /// Writes the sizes and gives the writer back.
    ///
    /// # Errors
    /// The writer's.
    pub fn finish(self) -> io::Result<W> {
        self.finish_with(&[])
    }

    /// As [`WavFile::finish`], with chunks after the samples.
    ///
    /// # Errors
    /// The writer's.
    pub fn finish_with(mut self, chunks: &[WavChunk]) -> io::Result<W> {
        let pad = self.data_bytes % 2;
        self.inner.write_all(&[0][..pad as usize])?;
        let mut after = Vec::new();
        for WavChunk { id, bytes } in chunks {
            after.extend(id);
            after.extend((bytes.len() as u32).to_le_bytes());
            after.extend(bytes);
            after.resize(after.len().next_multiple_of(2), 0);
        }
        self.inner.write_all(&after)?;
        let riff_bytes = self.header_bytes + self.data_bytes + pad + after.len() as u64 - 8;
        match u32::try_from(riff_bytes) {
            // The highest numbers mean "unknown" to readers.
            Ok(size) if size < 0xFFFF_0000 => self.write_riff_sizes(size, self.data_bytes as u32)?,
            _ => self.write_rf64_sizes(riff_bytes)?,
        }
        self.inner.flush()?;
        Ok(self.inner)
    }

    fn write_riff_sizes(&mut self, riff: u32, data: u32) -> io::Result<()> {
        self.write_at(4, &riff.to_le_bytes())?;
        self.write_at(self.header_bytes - 4, &data.to_le_bytes())
    }

    fn write_rf64_sizes(&mut self, riff_bytes: u64) -> io::Result<()> {
        self.write_at(0, b"RF64\xFF\xFF\xFF\xFF")?;
        let mut ds64 = b"ds64".to_vec();
        ds64.extend(DS64_BYTES.to_le_bytes());
        ds64.extend(riff_bytes.to_le_bytes());
        ds64.extend(self.data_bytes.to_le_bytes());
        ds64.extend((self.data_bytes / self.shape.frame_bytes().max(1)).to_le_bytes());
        ds64.extend(0u32.to_le_bytes());
        self.write_at(DS64_OFFSET, &ds64)?;
        self.write_at(self.header_bytes - 4, &u32::MAX.to_le_bytes())
    }

    fn write_at(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.inner.seek(SeekFrom::Start(offset))?;
        self.inner.write_all(bytes)
    }
}
