//! Writes WAV files: RIFF, or RF64 if the samples exceed 32-bit sizes.
//!
//! A file is begun as RIFF with a JUNK chunk where RF64's ds64 chunk would be; closing it writes
//! either the two 32-bit sizes or, past 4 GiB and for sizes that readers take as unknown, turns it into RF64
//! in place (EBU Tech 3306).

use super::header::{TAG_EXTENSIBLE, TAG_FLOAT, TAG_PCM, WavChunk, known_size};
use crate::io::PcmFormat;
use std::io::{self, Seek, SeekFrom, Write};

/// Content of a ds64 chunk: two sizes, the frame count and an empty table.
const DS64_BYTES: u32 = 28;
const DS64_OFFSET: u64 = 12;
/// From here on 32-bit sizes mean "unknown" to readers.
const LEAST_UNKNOWN_SIZE: u32 = 0xFFFF_0000;

/// The fmt chunk, and the bytes of a frame.
///
/// # Errors
/// `InvalidInput` if WAV has no such sample format, or no frames as long.
fn fmt_chunk(format: PcmFormat, channels: u16, rate: u32) -> io::Result<(Vec<u8>, u16)> {
    use PcmFormat::{F32Le, F64Le, S16Le, S24Le, S32Le, U8};
    let invalid = |message: String| io::Error::new(io::ErrorKind::InvalidInput, message);
    // WAV is little endian with unsigned bytes.
    if !matches!(format, U8 | S16Le | S24Le | S32Le | F32Le | F64Le) {
        let message = format!("WAV cannot hold {format}; use u8, s16le, s24le, s32le, f32le or f64le");
        return Err(invalid(message));
    }
    let frame = u16::try_from(format.bytes() * usize::from(channels)).map_err(|_| {
        let bytes = format.bytes();
        invalid(format!("{channels} channels of {bytes} bytes are longer than a frame of WAV, 65535 bytes"))
    })?;
    let tag = if format.is_float() { TAG_FLOAT } else { TAG_PCM };
    let bits = 8 * format.bytes() as u16;
    // More than two channels or more than 16 bits of integers ask for the extensible form.
    let extensible = channels > 2 || (!format.is_float() && format.bytes() > 2);
    let mut chunk = b"fmt ".to_vec();
    chunk.extend(if extensible { 40u32 } else { 16 }.to_le_bytes());
    chunk.extend(if extensible { TAG_EXTENSIBLE } else { tag }.to_le_bytes());
    chunk.extend(channels.to_le_bytes());
    chunk.extend(rate.to_le_bytes());
    chunk.extend(rate.saturating_mul(u32::from(frame)).to_le_bytes());
    chunk.extend(frame.to_le_bytes());
    chunk.extend(bits.to_le_bytes());
    if extensible {
        chunk.extend(22u16.to_le_bytes());
        chunk.extend(bits.to_le_bytes());
        // No speaker positions: the channels are converters, not loudspeakers.
        chunk.extend(0u32.to_le_bytes());
        chunk.extend(tag.to_le_bytes());
        chunk.extend([0, 0, 0, 0, 0x10, 0, 0x80, 0, 0, 0xAA, 0, 0x38, 0x9B, 0x71]);
    }
    Ok((chunk, frame))
}

/// The header of a stream of unknown length: sizes 0xFFFFFFFF, which readers of streams take as "until the
/// end".
///
/// # Errors
/// `InvalidInput` if WAV has no such sample format, or no frames as long.
pub fn stream_header(format: PcmFormat, channels: u16, rate: u32) -> io::Result<Vec<u8>> {
    let (fmt, _) = fmt_chunk(format, channels, rate)?;
    Ok([&b"RIFF\xFF\xFF\xFF\xFFWAVE"[..], &fmt, b"data\xFF\xFF\xFF\xFF"].concat())
}

/// A WAV file being written.
#[derive(Debug)]
pub(in crate::io) struct WavFile<W> {
    inner: W,
    frame_bytes: u16,
    header_bytes: u64,
    data_bytes: u64,
}

impl<W: Write + Seek> WavFile<W> {
    /// Begins a file at the start of `inner`.
    ///
    /// # Errors
    /// `InvalidInput` if WAV has no such sample format, or no frames as long; or the writer's own.
    pub(in crate::io) fn new(mut inner: W, format: PcmFormat, channels: u16, rate: u32) -> io::Result<Self> {
        let (fmt, frame_bytes) = fmt_chunk(format, channels, rate)?;
        let mut header = b"RIFF\0\0\0\0WAVEJUNK".to_vec();
        header.extend(DS64_BYTES.to_le_bytes());
        header.extend([0; DS64_BYTES as usize]);
        header.extend(fmt);
        header.extend(b"data\0\0\0\0");
        inner.write_all(&header)?;
        Ok(Self { inner, frame_bytes, header_bytes: header.len() as u64, data_bytes: 0 })
    }

    /// What it is written to.
    pub(in crate::io) fn inner_mut(&mut self) -> &mut W {
        &mut self.inner
    }

    /// Appends encoded samples.
    ///
    /// # Errors
    /// The writer's.
    pub(in crate::io) fn write_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.write_all(bytes)?;
        self.data_bytes += bytes.len() as u64;
        Ok(())
    }

    /// Writes `chunks` after the samples, then the sizes, and gives the writer back.
    ///
    /// # Errors
    /// The writer's.
    pub(in crate::io) fn finish(mut self, chunks: &[WavChunk]) -> io::Result<W> {
        let mut after = vec![0; (self.data_bytes % 2) as usize];
        let pad = after.len();
        for WavChunk { id, bytes } in chunks {
            after.extend(id);
            after.extend((bytes.len() as u32).to_le_bytes());
            after.extend(bytes);
            after.resize(pad + (after.len() - pad).next_multiple_of(2), 0);
        }
        self.inner.write_all(&after)?;
        let riff_bytes = self.header_bytes + self.data_bytes + after.len() as u64 - 8;
        let is_known = known_size(self.data_bytes, u64::from(self.frame_bytes), true).is_some();
        match u32::try_from(riff_bytes) {
            Ok(size) if is_known && size < LEAST_UNKNOWN_SIZE => {
                self.write_at(4, &size.to_le_bytes())?;
                self.write_at(self.header_bytes - 4, &(self.data_bytes as u32).to_le_bytes())?;
            }
            _ => self.write_rf64_sizes(riff_bytes)?,
        }
        self.inner.flush()?;
        Ok(self.inner)
    }

    fn write_rf64_sizes(&mut self, riff_bytes: u64) -> io::Result<()> {
        self.write_at(0, b"RF64\xFF\xFF\xFF\xFF")?;
        let mut ds64 = b"ds64".to_vec();
        ds64.extend(DS64_BYTES.to_le_bytes());
        ds64.extend(riff_bytes.to_le_bytes());
        ds64.extend(self.data_bytes.to_le_bytes());
        ds64.extend((self.data_bytes / u64::from(self.frame_bytes.max(1))).to_le_bytes());
        ds64.extend(0u32.to_le_bytes());
        self.write_at(DS64_OFFSET, &ds64)?;
        self.write_at(self.header_bytes - 4, &u32::MAX.to_le_bytes())
    }

    fn write_at(&mut self, offset: u64, bytes: &[u8]) -> io::Result<()> {
        self.inner.seek(SeekFrom::Start(offset))?;
        self.inner.write_all(bytes)
    }
}
