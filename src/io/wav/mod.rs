//! WAV files and streams: RIFF, RF64/BW64 and Sony Wave64 in, RIFF and RF64 out.
//!
//! The reader needs no seeking and takes what is found in the wild: streamed headers whose length
//! is unknown, odd chunks without their pad byte, headers of 16, 18 and 40 bytes, metadata before
//! the samples, truncated files. What it had to tolerate comes back as [`InputFault`](super::InputFault)s.

mod chunks;
mod header;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use header::WavHeader;
pub use reader::WavReader;
pub use writer::{WavFile, stream_header};
