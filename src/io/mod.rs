//! Input and output of samples: WAV, SigMF, tables, NumPy and MATLAB arrays, raw PCM, and lists of lost
//! samples.
//!
//! A *frame* holds one sample of each channel of a file or stream. A sample is stored in one of the
//! [`PcmFormat`]s; the full scale of integer formats is 1.0.

mod aligned_input;
mod array;
mod capture;
mod csv;
mod error;
#[cfg(feature = "flac")]
mod flac;
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
mod offline;
mod open;
mod pipe;
mod read_options;
mod sample_writer;
mod sigmf;
mod sigmf_reader;
mod stall;
#[cfg(target_os = "linux")]
mod stdin_reader;
mod stream_header;
pub(crate) mod table;
mod tar;
mod timestamps;
pub mod wav;

pub use crate::runtime::{ParsePcmFormatError, PcmFormat, PcmFrames, SampleLayout};
pub use array::{ArrayHeader, ArrayReader};
pub use csv::CsvReader;
pub use error::{InputFault, InputWarning, IoError};
pub use lost::{LiveLost, LostSamples};
pub use mat::{mat_variable, open_mat};
pub use multi_reader::{Arrival, MultiReader};
pub use notes::{OutputNotes, Placement};
pub use npy::npy_header;
pub use offline::{OfflineError, OfflineSamples, WORK_BYTES};
pub use open::is_self_describing;
pub use pipe::{Stdout, Watched, is_output_stalled, is_pipe, stderr, stdout};
pub use read_options::{BLOCK_BYTES, ReadOptions, TimeInterleaving, Until};
pub use sample_writer::{Container, OutputHeader, SampleWriter};
pub use sigmf::{SigmfAnnotation, SigmfCapture, SigmfGlobal, SigmfMeta, is_sigmf, sigmf_files};
pub use stall::{Stall, StallWatch};
pub use stream_header::{Coding, StreamHeader, is_same_rate};
pub use tar::{TarFile, tar_files};
pub use timestamps::{MAX_LOST, MAX_LOST_AT_ONCE};
