//! Reads frames from a WAV file or stream.

use super::chunks::{Chunks, KNOWN};
use super::header::{WavChunk, WavHeader};
use crate::files::fill;
use crate::io::capture::{ByteSource, InputNotes};
use crate::io::{IoError, StreamHeader};
use std::io::{self, Chain, Cursor, Read, Take};

/// A WAV source, positioned after its header; it reads as the bytes of its samples.
#[derive(Debug)]
pub struct WavReader<R> {
    header: WavHeader,
    data: Take<Chain<Cursor<Vec<u8>>, R>>,
    /// Bytes in further data chunks.
    further: u64,
}

impl<R: Read> WavReader<R> {
    /// Reads the header; `file` is the name in error messages.
    ///
    /// # Errors
    /// [`IoError`] for anything that is not plain PCM in RIFF, RF64 or BW64.
    pub fn new(inner: R, file: &str) -> Result<Self, IoError> {
        let mut chunks = Chunks::open(inner, file)?;
        let mut header = WavHeader::read(&mut chunks)?;
        let mut inner = chunks.into_inner();
        let mut peeked = Vec::new();
        if header.data_bytes == Some(0) {
            peeked.resize(4, 0);
            let count = fill(&mut inner, &mut peeked).map_err(IoError::system(file, "read it"))?;
            peeked.truncate(count);
            // No chunk follows: the writer did not come to state how many samples there are.
            header.data_bytes = (count == 0 || KNOWN.iter().any(|known| peeked == *known)).then_some(0);
        }
        let data = Cursor::new(peeked).chain(inner).take(header.data_bytes.unwrap_or(u64::MAX));
        Ok(Self { header, data, further: 0 })
    }

    /// The header.
    pub fn header(&self) -> &WavHeader {
        &self.header
    }
}

impl<R: Read> Read for WavReader<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.data.read(bytes)
    }
}

impl<R: Read> ByteSource for WavReader<R> {
    fn stream_header(&self) -> StreamHeader {
        let rate = f64::from(self.header.rate);
        let begin =
            self.header.chunks.iter().find_map(WavChunk::time_reference).map(|samples| samples as f64 / rate);
        let WavHeader { layout, channels, rate, data_bytes, valid_bits, .. } = self.header;
        let promised = data_bytes.map(|bytes| bytes / self.header.frame_bytes() as u64);
        StreamHeader {
            promised,
            begin,
            is_scaled: true,
            valid_bits: Some(valid_bits.into()),
            ..StreamHeader::real(layout, channels).at_whole_hertz(rate)
        }
    }

    fn missing_bytes(&self) -> u64 {
        self.header.data_bytes.map_or(0, |_| self.data.limit())
    }

    fn further_bytes(&self) -> u64 {
        self.further
    }

    fn notes(&self) -> InputNotes {
        InputNotes { chunks: self.header.chunks.clone(), ..InputNotes::default() }
    }

    /// What is damaged there is left out: the samples matter.
    fn chunks_after(&mut self) -> Vec<WavChunk> {
        let mut chunks = Vec::new();
        let is_whole = self.data.limit() == 0;
        let Some(data_bytes) = self.header.data_bytes.filter(|_| is_whole) else { return chunks };
        let inner = self.data.get_mut();
        let mut pad = data_bytes % 2;
        let mut head = [0; 8];
        while io::copy(&mut inner.take(pad), &mut io::sink()).is_ok() && inner.read_exact(&mut head).is_ok() {
            let [a, b, c, d, size @ ..] = head;
            let (id, size) = ([a, b, c, d], u64::from(u32::from_le_bytes(size)));
            pad = size % 2;
            if &id == b"data" {
                self.further = self.further.saturating_add(size);
            }
            if WavChunk::may_be(&id, size, &chunks) {
                let mut bytes = vec![0; size as usize];
                if inner.read_exact(&mut bytes).is_err() {
                    break;
                }
                chunks.extend(WavChunk::new(id, bytes));
            } else {
                pad += size;
            }
        }
        chunks
    }
}
