//! Errors of reading and writing samples, and faults of inputs that are tolerated.

use crate::files::FileError;
use crate::messages::{Number, Quoted, counted};
use crate::quantity::FullScale;
use std::io;

/// A fault of a file or stream; every sentence names the file, the place, the rule and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// The operating system refused, or a file could not be read or written as a whole.
    #[error(transparent)]
    File(#[from] FileError),
    /// The first bytes are not those of a WAV file.
    #[error(
        "{}: not a WAV file (byte 0 holds {found}, where RIFF, RF64 or BW64 is expected); raw samples need a format name such as f32le, a table through a pipe the format csv, and other recordings their usual ending",
        Quoted(.file)
    )]
    NotWav {
        /// Name of the file.
        file: String,
        /// The bytes found, printable.
        found: String,
    },
    /// A file that is not of its kind, or holds no samples that can be read.
    #[error("{}: not {kind} that can be read: {problem}", Quoted(.file))]
    Malformed {
        /// Name of the file.
        file: String,
        /// What its name says that it is, with its article.
        kind: &'static str,
        /// Place, reason and remedy.
        problem: String,
    },
    /// Inputs that do not fit the settings, one another, or the output.
    #[error("{}: {problem}", Quoted(.file))]
    Unfit {
        /// Name of the file.
        file: String,
        /// The rule and the remedy; for a file of lost samples with its line.
        problem: String,
    },
}

impl IoError {
    /// Wraps the system's refusal; for use with `map_err`.
    pub fn system(file: &str, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        let error = FileError::system(file, action);
        move |source| Self::File(error(source))
    }

    /// Names what is wrong with a file of this kind; for use with `map_err`.
    pub(super) fn malformed(file: &str, kind: &'static str) -> impl FnOnce(String) -> Self {
        let file = file.to_owned();
        move |problem| Self::Malformed { file, kind, problem }
    }

    /// Names what does not fit; for use with `map_err`.
    pub(super) fn unfit(file: &str) -> impl FnOnce(String) -> Self {
        let file = file.to_owned();
        move |problem| Self::Unfit { file, problem }
    }

    /// An error of reading samples, which may hold one of these errors; for use with `map_err`.
    pub(super) fn reading(file: &str) -> impl FnOnce(io::Error) -> Self {
        let refused = Self::system(file, "read the samples");
        move |error| error.downcast::<Self>().unwrap_or_else(refused)
    }

    /// True if the reader of a pipe went away, which ends a stream quietly.
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::File(FileError::System { source, .. }) if source.kind() == io::ErrorKind::BrokenPipe)
    }
}

/// For readers of bytes whose errors say more; `IoError::reading` takes them back.
impl From<IoError> for io::Error {
    fn from(error: IoError) -> Self {
        Self::other(error)
    }
}

/// A fault that was tolerated; complete when the input has ended.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InputFault {
    /// The file is shorter than its header says.
    #[error("the file is truncated: {missing_bytes} bytes that its header promises are missing")]
    Truncated {
        /// Number of missing bytes.
        missing_bytes: u64,
    },
    /// The last frame was cut and left out.
    #[error("the last frame is cut ({bytes} bytes of it are there) and was left out")]
    CutFrame {
        /// Number of its bytes that were present.
        bytes: usize,
    },
    /// Samples follow in another chunk.
    #[error(
        "{bytes} bytes of samples follow in another data chunk and were left out; write the recording with one data chunk"
    )]
    FurtherSamples {
        /// Number of these bytes.
        bytes: u64,
    },
    /// The file of samples of a SigMF recording has another digest than its metadata state.
    #[error("its samples do not have the core:sha512 of its metadata: they were changed or damaged later")]
    Altered,
    /// The first column of a table was left out.
    #[error(
        "its first column is a steady ramp and was taken for the times or an index of the lines, not for a channel; state it \
         (--time-column 1, or none if it is a channel)"
    )]
    RampLeftOut,
    /// Times of a table lie several steps apart.
    #[error("its times leave out {}; the samples there count as lost", counted(*.lines as usize, "line"))]
    LinesMissing {
        /// Number of these lines.
        lines: u64,
    },
    /// The preamble of a table states another rate than that of its times.
    #[error(
        "its preamble states a rate of {} Hz, but its times have {} Hz, which was taken", Number(*.stated), Number(*.found)
    )]
    OtherRate {
        /// The rate of the preamble in hertz.
        stated: f64,
        /// That of the times.
        found: f64,
    },
    /// The input ended before the last sample whose number at the converter is given.
    #[error("it ends before the last of the samples whose number is given")]
    TimestampsBeyondEnd,
    /// A SigMF recording does not state its rate.
    #[error("it states no core:sample_rate; the rate of the bank is assumed")]
    NoRate,
    /// Samples beyond full scale, which is 1, of an input that does not state its own.
    #[error(
        "its samples reach {}, and full scale is 1 unless it is stated{}", Number(*.peak),
        .likely.map_or_else(String::new, |likely| format!("; as whole numbers they look like codes, with a full scale of {likely}"))
    )]
    BeyondFullScale {
        /// The largest magnitude.
        peak: f64,
        /// The codes that whole numbers are.
        likely: Option<FullScale>,
    },
    /// Codes of an input that does not state its full scale leave bits of their words unused.
    #[error(
        "its codes use {likely} of words of {bits}; if these are the bits of the converter, its full scale is smaller than that \
         of the words, so state it"
    )]
    UnusedBits {
        /// Bits of the words.
        bits: u32,
        /// The codes that they look like.
        likely: FullScale,
    },
    /// Samples at the ends of the range of the converter, where it clips.
    #[error("{count} of {of} samples are at an end of the range of the converter, where it clips")]
    AtRails {
        /// How many.
        count: u64,
        /// All samples.
        of: u64,
    },
    /// Samples at one level within the range of the converter, where something before it clips.
    #[error(
        "channel {channel} is flat at {level:.4} of full scale far more often than its top could be: the signal is clipped there"
    )]
    FlatTop {
        /// From 1, in the input.
        channel: usize,
        /// Where it is clipped, of full scale.
        level: f64,
    },
    /// The input is longer than the shortest one, which decided where to end.
    #[error(
        "longer than the shortest channel, {}{frames} samples per channel were not used",
        if *.at_least { "at least " } else { "" }
    )]
    Unused {
        /// Frames that were not used.
        frames: u64,
        /// There may be more frames, which were not read.
        at_least: bool,
    },
}

impl InputFault {
    /// True if samples are at a limit beyond which the signal went.
    pub fn is_clipping(&self) -> bool {
        matches!(self, Self::AtRails { .. } | Self::FlatTop { .. })
    }
}

/// A fault with the input that has it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}: {fault}", Quoted(.input))]
pub struct InputWarning {
    /// Name of the input.
    pub input: String,
    /// What is wrong with it.
    pub fault: InputFault,
}
