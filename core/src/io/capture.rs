//! What every kind of input is: a header, and interleaved frames.

use super::block::Block;
use super::sigmf::SigmfMeta;
use super::timestamps::Timestamps;
use super::wav::WavChunk;
use super::{InputFault, IoError, StreamHeader};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// An opened input: a header, and blocks of frames. Each kind of input implements it once; those whose
/// samples are bytes do so as a [`ByteSource`].
pub(super) trait Capture {
    /// Format, channels and rate, as stored.
    fn stream_header(&self) -> StreamHeader;

    /// Appends the next frames, about `bytes` bytes of them at most, to `block`, which is one of this
    /// header; there may be none yet. False at the end.
    fn read_block(&mut self, bytes: usize, block: &mut Block) -> Result<bool, io::Error>;

    /// What it says besides its samples.
    fn notes(&self) -> InputNotes {
        InputNotes::default()
    }

    /// What was tolerated; to be asked once, when all samples have been read.
    fn faults(&mut self) -> Vec<InputFault> {
        Vec::new()
    }

    /// Chunks after the samples, once these have all been read.
    fn chunks_after(&mut self) -> Vec<WavChunk> {
        Vec::new()
    }
}

/// An input that reads as the bytes of interleaved frames.
pub(super) trait ByteSource: Read {
    /// As [`Capture::stream_header`].
    fn stream_header(&self) -> StreamHeader;

    /// Bytes that the input promised and that have not come; known at the end.
    fn missing_bytes(&self) -> u64 {
        0
    }

    /// What it says besides its samples.
    fn notes(&self) -> InputNotes {
        InputNotes::default()
    }

    /// Bytes of further samples, which are not read; known after [`ByteSource::chunks_after`].
    fn further_bytes(&self) -> u64 {
        0
    }

    /// Whether the bytes are others than those that it was written with, as far as it says so; to be asked
    /// once, when all samples have been read.
    fn is_altered(&mut self) -> bool {
        false
    }

    /// Chunks after the samples, once these have all been read.
    fn chunks_after(&mut self) -> Vec<WavChunk> {
        Vec::new()
    }
}

/// What an input says.
#[derive(Debug, Clone, Default)]
pub(super) struct InputNotes {
    /// The metadata of a SigMF recording.
    pub(super) sigmf: Option<Box<SigmfMeta>>,
    /// When its frames were taken.
    pub(super) timestamps: Timestamps,
    /// Samples per frame of time-interleaved converters, or 1.
    pub(super) samples_per_frame: usize,
    /// Samples per frame of a converter that samples more often than there are frames, or 1.
    pub(super) per_frame: usize,
    /// Chunks of a WAV file.
    pub(super) chunks: Vec<WavChunk>,
}

impl InputNotes {
    /// The same notes where so many samples of the input are a frame.
    pub(super) fn grouped(self, samples_per_frame: usize) -> Result<Self, String> {
        Ok(Self { timestamps: self.timestamps.grouped(samples_per_frame)?, samples_per_frame, ..self })
    }
}

pub(super) fn open_file(path: &Path) -> Result<File, IoError> {
    File::open(path).map_err(IoError::system(&path.display().to_string(), "open it"))
}

/// Bytes that are made a block at a time and read in pieces.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    bytes: Vec<u8>,
    /// How many of them have been read.
    given: usize,
}

impl Blocks {
    /// Reads on; `refill` puts the next block into an empty vector, and leaves it empty at the end.
    pub(super) fn read<E: Into<io::Error>>(
        &mut self,
        into: &mut [u8],
        refill: impl FnOnce(&mut Vec<u8>) -> Result<(), E>,
    ) -> io::Result<usize> {
        if self.given == self.bytes.len() {
            self.bytes.clear();
            self.given = 0;
            refill(&mut self.bytes).map_err(Into::into)?;
        }
        let count = (&self.bytes[self.given..]).read(into)?;
        self.given += count;
        Ok(count)
    }
}
