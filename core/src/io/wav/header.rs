//! The contents of a WAV header.

use super::chunks::{Chunk, Chunks};
use crate::io::{IoError, PcmFormat, SampleLayout};
use std::io::Read;

pub(super) const TAG_PCM: u16 = 1;
pub(super) const TAG_FLOAT: u16 = 3;
pub(super) const TAG_EXTENSIBLE: u16 = 0xFFFE;

/// Chunks that say something about the recording; others hold positions in its samples, or are unknown.
const NOTES: [&[u8; 4]; 3] = [b"bext", b"iXML", b"LIST"];
/// Longest chunk that is kept, and longest in all before the samples; as much again after them.
const LONGEST_NOTE: u64 = 1 << 20;
const ALL_NOTES: usize = 4 << 20;
/// Most chunks that are kept before the samples, and again after them; recorders write a handful, and each
/// costs a look at those before it.
const MOST_NOTES: usize = 64;

/// A chunk that says something about the recording: `bext`, `iXML`, or `LIST` of the type `INFO`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WavChunk {
    /// Its name.
    pub id: [u8; 4],
    /// Its content.
    pub bytes: Vec<u8>,
}

impl WavChunk {
    /// Whether a chunk of this name and size, beside those that are kept, may be one.
    pub(super) fn may_be(id: &[u8; 4], size: u64, kept: &[Self]) -> bool {
        let bytes: usize = kept.iter().map(|chunk| chunk.bytes.len()).sum();
        let has_room = kept.len() < MOST_NOTES && bytes <= ALL_NOTES - LONGEST_NOTE as usize;
        NOTES.contains(&id) && size <= LONGEST_NOTE && has_room
    }

    /// Where the Broadcast Wave chunk counts the samples since midnight (EBU Tech 3285).
    pub(in crate::io) const TIME_REFERENCE: std::ops::Range<usize> = 338..346;

    /// Samples from midnight to the first sample, if this is a Broadcast Wave chunk.
    pub(in crate::io) fn time_reference(&self) -> Option<u64> {
        let field = self.bytes.get(Self::TIME_REFERENCE).filter(|_| &self.id == b"bext")?;
        field.try_into().map(u64::from_le_bytes).ok()
    }

    /// The chunk, unless it is a list of something else.
    pub(super) fn new(id: [u8; 4], bytes: Vec<u8>) -> Option<Self> {
        (&id != b"LIST" || bytes.starts_with(b"INFO")).then_some(Self { id, bytes })
    }
}

/// A checked header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WavHeader {
    /// The layout of a sample.
    pub layout: SampleLayout,
    /// Samples per frame, at least 1.
    pub channels: usize,
    /// Frames per second, at least 1.
    pub rate: u32,
    /// Bytes of samples, `None` if they go on until the end.
    pub data_bytes: Option<u64>,
    /// Where the samples begin.
    pub data_offset: u64,
    /// What is said of the recording before the samples.
    pub chunks: Vec<WavChunk>,
    /// Bits of a sample that count. By the rule they are the high ones; some writers use the low ones.
    pub valid_bits: u16,
}

/// The fmt chunk, as written.
struct Fmt {
    offset: u64,
    tag: u16,
    channels: u16,
    rate: u32,
    block_align: u16,
    bits: u16,
    /// Valid bits of an extensible header; 0 where there is none.
    valid_bits: u16,
}

impl WavHeader {
    /// Bytes per frame.
    pub fn frame_bytes(&self) -> usize {
        self.layout.container * self.channels
    }

    /// Reads up to the first sample.
    pub(super) fn read<R: Read>(chunks: &mut Chunks<'_, R>) -> Result<Self, IoError> {
        let mut fmt = None;
        let mut true_size = None;
        let mut notes = Vec::new();
        while let Some(chunk) = chunks.next()? {
            match &chunk.id {
                b"fmt " => fmt = Some(Fmt::read(chunks, chunk)?),
                b"ds64" => true_size = Some(read_ds64(chunks, chunk)?),
                b"data" => {
                    let fmt = fmt.ok_or_else(|| no_fmt(chunks, chunk))?;
                    let header = Self::assemble(chunks, &fmt, chunk, true_size)?;
                    return Ok(Self { chunks: notes, ..header });
                }
                id if WavChunk::may_be(id, chunk.size, &notes) => {
                    let mut bytes = vec![0; chunk.size as usize];
                    chunks.exact(&mut bytes, "a chunk of metadata")?;
                    chunks.skip(chunk, chunk.size)?;
                    notes.extend(WavChunk::new(chunk.id, bytes));
                }
                _ => chunks.skip(chunk, 0)?,
            }
        }
        let offset = chunks.offset();
        Err(chunks.malformed(format!("no data chunk after {offset} bytes of header; it holds no samples")))
    }

    fn assemble<R: Read>(
        chunks: &Chunks<'_, R>,
        fmt: &Fmt,
        data: Chunk,
        true_size: Option<u64>,
    ) -> Result<Self, IoError> {
        let channels = usize::from(fmt.channels);
        let layout = fmt.layout(chunks)?;
        let frame = (layout.container * channels) as u64;
        let data_bytes = match true_size.filter(|_| chunks.is_rf64) {
            // 0 or more than any disk holds: the writer did not know the size.
            Some(size) if data.size == u64::from(u32::MAX) => (1..1 << 62).contains(&size).then_some(size),
            _ => known_size(data.size, frame, chunks.promised > data.offset && chunks.promised < 0x7FFF_0000),
        };
        Ok(Self {
            layout,
            channels,
            rate: fmt.rate,
            data_bytes,
            data_offset: data.offset,
            chunks: Vec::new(),
            valid_bits: fmt.significant_bits(),
        })
    }
}

/// The data size, unless it is one of the numbers with which streaming writers mean "until the end".
/// `empty_possible`: the outer size promises chunks after the data, so that 0 may mean no samples.
pub(super) fn known_size(size: u64, frame: u64, empty_possible: bool) -> Option<u64> {
    // sox rounds its 0x7FFFF000 down to whole frames; others take the header off.
    let streamed_by_sox = size <= 0x7FFF_F000 && size + frame.max(128) > 0x7FFF_F000;
    let streamed = streamed_by_sox
        || (0x7FFF_FF00..=0x7FFF_FFFF).contains(&size)
        || (0xFFFF_0000..=0xFFFF_FFFF).contains(&size)
        || (size == 0 && !empty_possible);
    (!streamed).then_some(size)
}

fn no_fmt<R: Read>(chunks: &Chunks<'_, R>, data: Chunk) -> IoError {
    chunks.bad(
        "the data chunk",
        data.offset,
        data.size,
        "a fmt chunk must come before it; the file is damaged",
    )
}

/// The true size of the data.
fn read_ds64<R: Read>(chunks: &mut Chunks<'_, R>, chunk: Chunk) -> Result<u64, IoError> {
    let _riff_size: [u8; 8] = chunks.bytes("the ds64 chunk")?;
    let size = u64::from_le_bytes(chunks.bytes("the ds64 chunk")?);
    chunks.skip(chunk, 16)?;
    Ok(size)
}

impl Fmt {
    fn read<R: Read>(chunks: &mut Chunks<'_, R>, chunk: Chunk) -> Result<Self, IoError> {
        if chunk.size < 16 {
            let rule = "a fmt chunk has at least 16 bytes; the file is damaged";
            return Err(chunks.bad("the fmt chunk's size", chunk.offset - 4, chunk.size, rule));
        }
        let mut bytes = [0u8; 40];
        let used = chunk.size.min(40);
        chunks.exact(&mut bytes[..used as usize], "the fmt chunk")?;
        chunks.skip(chunk, used)?;
        let fmt = Self::parse(&bytes, chunk.offset);
        fmt.check(chunks)?;
        Ok(fmt)
    }

    fn parse(bytes: &[u8; 40], offset: u64) -> Self {
        let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let tag = word(0);
        let extensible = tag == TAG_EXTENSIBLE;
        Self {
            offset,
            // A truncated extensible header has no format tag, so PCM is the best guess.
            tag: if extensible { word(24).max(TAG_PCM) } else { tag },
            channels: word(2),
            rate: u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]),
            block_align: word(12),
            bits: word(14),
            valid_bits: if extensible { word(18) } else { 0 },
        }
    }

    fn check<R: Read>(&self, chunks: &Chunks<'_, R>) -> Result<(), IoError> {
        let at = |within: u64| self.offset + within;
        if self.channels == 0 {
            return Err(chunks.bad("the channel count", at(2), 0, "a file has at least one channel"));
        }
        if self.rate == 0 {
            return Err(chunks.bad("the sample rate", at(4), 0, "a rate is at least 1 Hz"));
        }
        if !self.block_align.is_multiple_of(self.channels) {
            let rule = "bytes per frame must be a multiple of the channel count";
            return Err(chunks.bad("the frame size", at(12), self.block_align.into(), rule));
        }
        Ok(())
    }

    /// Bytes from sample to sample; writers that leave the frame size 0 mean packed samples.
    fn container(&self) -> usize {
        match self.block_align / self.channels {
            0 => usize::from(self.bits).div_ceil(8),
            bytes => usize::from(bytes),
        }
    }

    /// Bits that count: the valid bits where given and possible, or else the container's.
    fn significant_bits(&self) -> u16 {
        if self.valid_bits == 0 || self.valid_bits > self.bits { self.bits } else { self.valid_bits }
    }

    /// The whole container, in whose high bits samples of fewer bits lie by the rule.
    fn layout<R>(&self, chunks: &Chunks<'_, R>) -> Result<SampleLayout, IoError>
    where
        R: Read,
    {
        let container = self.container();
        let fits = self.bits > 0 && usize::from(self.bits) <= 8 * container;
        let format = match (self.tag, container) {
            (TAG_PCM, 1) if fits => PcmFormat::U8,
            (TAG_PCM, 2) if fits => PcmFormat::S16Le,
            (TAG_PCM, 3) if fits => PcmFormat::S24Le,
            (TAG_PCM, 4) if fits => PcmFormat::S32Le,
            (TAG_FLOAT, 4) if self.bits == 32 => PcmFormat::F32Le,
            (TAG_FLOAT, 8) if self.bits == 64 => PcmFormat::F64Le,
            _ => {
                let (tag, bits) = (self.tag, self.bits);
                return Err(chunks.malformed(format!(
                    "samples are coded as format tag {tag:#06x} with {bits} bits; convert to integer PCM or float \
                     first (for example: sox IN.wav -e float OUT.wav)"
                )));
            }
        };
        Ok(SampleLayout { format, container })
    }
}
