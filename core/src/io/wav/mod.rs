//! WAV files and streams: RIFF and RF64/BW64 in, RIFF and RF64 out.
//!
//! The reader does not seek. It accepts common deviations from the standards: streamed headers with unknown
//! length, odd chunks without their pad byte, headers of 16, 18 and 40 bytes, metadata before the samples,
//! truncated files. Each tolerated fault is reported as an [`InputFault`](super::InputFault).
//!
//! ```
//! use hybank_core::io::{PcmFormat, wav};
//! use std::io::Read;
//! let mut stream = wav::stream_header(PcmFormat::S16Le, 2, 48_000)?;
//! stream.extend([1, 0, 2, 0]);
//! let mut reader = wav::WavReader::new(&stream[..], "standard input")?;
//! let header = reader.header();
//! // A stream does not say how long it is.
//! assert_eq!((header.channels, header.rate, header.data_bytes), (2, 48_000, None));
//! let mut frame = vec![0; header.frame_bytes()];
//! reader.read_exact(&mut frame)?;
//! assert_eq!(frame, [1, 0, 2, 0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod chunks;
mod header;
mod reader;
mod writer;

pub use header::{WavChunk, WavHeader};
pub use reader::WavReader;
pub(super) use writer::WavFile;
pub use writer::stream_header;

#[cfg(test)]
mod tests;
