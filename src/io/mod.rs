//! Samples in and out: WAV, SigMF, raw PCM, what is known of lost samples, whole-file writers.
//!
//! Words: a *frame* holds one sample of each channel of a file or stream; a sample is stored in
//! one of the [`PcmFormat`]s; integer formats are full scale = 1.0.

mod atomic;
#[cfg(target_os = "linux")]
mod direct;
mod error;
mod feed;
mod frames;
mod lane;
mod lost;
mod pipe;
mod reader;
mod sequence;
mod sigmf;
pub mod wav;

pub use crate::runtime::{ParsePcmFormatError, PcmFormat, PcmFrames, SampleLayout};
pub use atomic::AtomicFile;
pub use error::IoError;
pub use feed::{Arrival, BLOCK_BYTES, Coding, Feed, FeedOptions, Until};
pub use frames::FrameReader;
pub use lost::LostSamples;
pub use pipe::stdout_file;
pub use sequence::MOST_LOST;
pub use sigmf::{SigmfCapture, SigmfGlobal, SigmfMeta};
