//! Captures in memory: from files or from arrays, of the converters of a bank or a spec, or of any recorder.
//!
//! Here samples become numbers, with the range that their format gives them. The commands and the Python
//! package take them from here.
//!
//! ```
//! use hybank::captures::Captures;
//! use hybank::io::{Decoder, StatedScale};
//! use hybank::runtime::{PcmFormat, PcmFrames, SampleLayout};
//! // Two frames of two channels.
//! let bytes: Vec<u8> = [0i16, -32768, 16384, 32767].into_iter().flat_map(i16::to_le_bytes).collect();
//! let stored = PcmFrames { layout: SampleLayout::packed(PcmFormat::S16Le), channels: 2, bytes: &bytes };
//! let frames = Decoder::new(&stored, false, StatedScale::default())?.decode(&stored)?;
//! let captures = Captures::of_frames(&[frames])?;
//! assert_eq!(captures.channels[0].samples, [0.0, 0.5]);
//! assert_eq!(captures.channels[1].rails, Some((-1.0, 32767.0 / 32768.0)));
//! // Both samples of the second channel are at an end of their range.
//! assert_eq!(captures.channels[1].record(None).clipped, 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod channel;
mod converters;
mod error;
mod in_memory;
mod levels;

pub use channel::ChannelSamples;
pub use converters::{Converters, FileFormat};
pub use error::CaptureError;
pub use in_memory::Captures;
pub use levels::LevelTrack;
