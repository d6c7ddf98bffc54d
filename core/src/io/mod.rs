//! Input and output of samples: WAV, SigMF, tables, NumPy and MATLAB arrays, raw PCM, and lists of lost
//! samples.
//!
//! A *frame* holds one sample of each channel of a file or stream. A sample is stored in one of the
//! [`PcmFormat`]s; the full scale of integer formats is 1.0.
//!
//! A recording is written by [`SampleWriter`] and read by [`MultiReader`], side by side with others:
//!
//! ```
//! use hybank_core::files::commit_all;
//! use hybank_core::io::{Container, OutputHeader, PcmFormat, SampleWriter};
//! use hybank_core::io::{MultiReader, OfflineSamples, ReadOptions};
//!
//! let path = std::env::temp_dir().join(format!("hybank-io-{}.wav", std::process::id()));
//! let (container, format) = (Container::Wav, PcmFormat::S16Le);
//! let header = OutputHeader { container, format, is_complex: false, rate: 48_000.0 };
//! let mut writer = SampleWriter::create(&path, header, true)?;
//! writer.write(&[0x00, 0x40, 0x00, 0xC0])?;
//! commit_all(writer.finish()?)?;
//!
//! let mut reader = MultiReader::start(&[path.clone()], ReadOptions::files(), &mut |_| {})?;
//! assert!(reader.headers().all(|(_, header)| header.rate == Some(48_000.0)));
//! assert_eq!(OfflineSamples::read(&mut reader, 1000)?.channels, [[0.5, -0.5]]);
//! # std::fs::remove_file(path)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod aligned_input;
mod array;
mod block;
mod byte_frames;
mod capture;
mod decoded;
mod error;
#[cfg(feature = "flac")]
mod flac;
mod frame_file;
mod frames;
mod full_scale;
mod grouped;
mod input;
mod lost;
mod mat;
mod mat_element;
mod multi_reader;
mod notes;
mod npy;
mod npy_writer;
mod offline;
mod open;
mod pipe;
mod rails;
mod read_options;
mod sample_writer;
mod sigmf;
mod sigmf_reader;
mod stall;
mod stream_header;
pub mod table;
mod timestamps;
pub mod wav;

pub use crate::runtime::{ParsePcmFormatError, PcmFormat, PcmFrames, SampleLayout};
pub use array::{ArrayHeader, ArrayReader};
pub use block::{NumberFrames, RecordedFrames};
pub use decoded::{DecodeError, DecodedFrames, Decoder};
pub use error::{InputFault, InputWarning, IoError};
pub use frame_file::FrameFile;
pub use full_scale::{StatedScale, Word};
pub use lost::LostSamples;
pub use mat::{mat_variable, open_mat};
pub use multi_reader::{Arrival, MultiReader};
pub use notes::{OutputNotes, Placement};
pub use npy::npy_header;
pub use offline::{OfflineError, OfflineSamples, check_real};
pub use open::is_self_describing;
pub use pipe::{is_pipe, open_fifo, stdout_file};
pub use rails::rails_of;
pub use read_options::{BLOCK_BYTES, ReadOptions, TimeInterleaving, Until};
pub use sample_writer::{Container, OutputHeader, SampleWriter};
pub use sigmf::{SigmfAnnotation, SigmfCapture, SigmfGlobal, SigmfMeta, is_sigmf, sigmf_files};
pub use stall::{OnStall, Stall};
pub use stream_header::{Coding, StreamHeader, is_same_rate};
pub use timestamps::{MAX_LOST, MAX_LOST_AT_ONCE};
