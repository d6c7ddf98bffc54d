//! Samples in and out: WAV, raw PCM, whole-file writers.
//!
//! Words: a *frame* holds one sample of each channel of a file or stream; a sample is stored in
//! one of the [`PcmFormat`]s; integer formats are full scale = 1.0.

mod atomic;
mod capture;
mod error;
mod feed;
mod frames;
mod pcm;
mod pcm_frames;
mod sigmf;
pub mod wav;

pub use atomic::AtomicFile;
pub use capture::{Capture, CaptureNote};
pub use error::IoError;
pub use feed::{Arrival, Coding, Feed, stdout_file};
pub use frames::FrameReader;
pub(crate) use pcm::for_pcm_format;
pub use pcm::{ParsePcmFormatError, PcmFormat};
pub use pcm_frames::{PcmFrames, SampleLayout};
pub use sigmf::{SigmfCapture, SigmfGlobal, SigmfMeta};
