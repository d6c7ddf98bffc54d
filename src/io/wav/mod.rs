//! WAV files and streams: RIFF and RF64/BW64 in, RIFF and RF64 out.
//!
//! The reader does not seek. It accepts common deviations from the standards: streamed headers with unknown
//! length, odd chunks without their pad byte, headers of 16, 18 and 40 bytes, metadata before the samples,
//! truncated files. Each tolerated fault is reported as an [`InputFault`](super::InputFault).

mod chunks;
mod header;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use header::{WavChunk, WavHeader};
pub use reader::WavReader;
pub use writer::{WavFile, stream_header};
