//! Errors of reading and writing samples.

use crate::files::FileError;
use std::io;

/// A fault of a file or stream; every sentence names the file, the place, the rule and the remedy.
#[derive(Debug, thiserror::Error)]
pub enum IoError {
    /// The operating system refused.
    #[error("{file}: cannot {action}: {source}")]
    System {
        /// Name of the file or stream.
        file: String,
        /// The action that failed, as an imperative phrase: `open it`.
        action: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// A file could not be read or written as a whole.
    #[error(transparent)]
    File(#[from] FileError),
    /// The thread that read an input ended before the input did. This is a bug of this program.
    #[error(
        "{file}: its reader ended before the input did, so the rest is not known; this is a fault of hybank, please report it"
    )]
    ReaderDied {
        /// Name of the input.
        file: String,
    },
    /// One pipe is given for two inputs.
    #[error(
        "{first} and {second} are the same pipe, each byte of which only one of them would get; give each channel a pipe of its own"
    )]
    SharedPipe {
        /// Name of one input.
        first: String,
        /// Name of the other.
        second: String,
    },
    /// The first bytes are not those of a WAV file.
    #[error(
        "{file}: not a WAV file (byte 0 holds {found}, where RIFF, RF64, BW64 or a W64 header is expected); raw samples need a format name such as f32le"
    )]
    NotWav {
        /// Name of the file.
        file: String,
        /// The bytes found, printable.
        found: String,
    },
    /// A WAV header among raw samples.
    #[error("{file}: it begins with a WAV header, but raw samples are expected; give --format wav")]
    WavAmongRaw {
        /// Name of the input.
        file: String,
    },
    /// The header is truncated.
    #[error(
        "{file}: the header ends at byte {offset} inside {place}; the file is truncated, record or copy it again"
    )]
    TruncatedHeader {
        /// Name of the file.
        file: String,
        /// Where the bytes ended.
        offset: u64,
        /// Which part was being read.
        place: &'static str,
    },
    /// A header field holds a value that cannot be.
    #[error("{file}: {field} at byte {offset} is {value}; {rule}")]
    BadField {
        /// Name of the file.
        file: String,
        /// The field's name.
        field: &'static str,
        /// Its offset in bytes.
        offset: u64,
        /// What it holds.
        value: u64,
        /// What it may hold, and the remedy.
        rule: &'static str,
    },
    /// The samples are not plain PCM.
    #[error(
        "{file}: samples are coded as format tag {tag:#06x} with {bits} bits; convert to integer PCM or float first (for example: sox {file} -e float out.wav)"
    )]
    Encoding {
        /// Name of the file.
        file: String,
        /// The WAV format tag.
        tag: u16,
        /// Bits per sample.
        bits: u16,
    },
    /// A SigMF recording that does not hold plain real samples.
    #[error("{file}: not a SigMF recording that can be read: {problem}")]
    Sigmf {
        /// Name of the metadata file.
        file: String,
        /// What is wrong, and the remedy.
        problem: String,
    },
    /// A file that is not of its kind, or holds no samples.
    #[error("{file}: not {kind} that can be read: {problem}")]
    Malformed {
        /// Name of the file.
        file: String,
        /// What its name says that it is, with its article.
        kind: &'static str,
        /// Place, reason and remedy.
        problem: String,
    },
    /// A recording that this program was built without the decoders for.
    #[error(
        "{file}: this hybank was built without decoders for FLAC, MP3, AIFF and Ogg; build it with them (cargo install \
         --path . --features audio), or give a pipe: ffmpeg -i {file} -f wav -c:a pcm_f32le - | hybank fuse BANK.json -"
    )]
    Encoded {
        /// Name of the file.
        file: String,
    },
    /// An input lacks the channel that was chosen.
    #[error("--channel {channel}: {file} has {channels} channels, counted from 1")]
    NoChannel {
        /// Name of the input.
        file: String,
        /// The channel, from 1.
        channel: usize,
        /// Channels of the input.
        channels: usize,
    },
    /// Some inputs are complex and some are real.
    #[error("{complex} holds complex samples and {real} real ones; give all channels in one of the two ways")]
    SomeComplex {
        /// Name of a complex input.
        complex: String,
        /// Name of a real input.
        real: String,
    },
    /// An input in which converters take turns has more than one channel.
    #[error(
        "{file}: {channels} channels, but converters that take turns share one; read it without --interleaved, or \
         extract that channel first"
    )]
    TurnsInChannels {
        /// Name of the input.
        file: String,
        /// Channels of the input.
        channels: usize,
    },
    /// A file of lost samples that is malformed or does not fit the inputs.
    #[error("{file}: {problem}")]
    Lost {
        /// Name of the file.
        file: String,
        /// Line, reason and remedy.
        problem: String,
    },
    /// The rate of an output is too high for WAV.
    #[error(
        "{file}: the rate of {rate} Hz does not fit a WAV header; give the output a name that ends in sigmf-meta, or write raw samples with `hybank stream`"
    )]
    WavRate {
        /// Name of the file.
        file: String,
        /// The rate in hertz.
        rate: f64,
    },
    /// There is no data chunk.
    #[error("{file}: no data chunk after {offset} bytes of header; the file holds no samples")]
    NoData {
        /// Name of the file.
        file: String,
        /// Where the search ended.
        offset: u64,
    },
}

impl IoError {
    /// Wraps the system's refusal; for use with `map_err`.
    pub fn system(file: &str, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        let file = file.to_owned();
        move |source| Self::System { file, action, source }
    }

    /// An error of reading samples, which may hold one of these errors; for use with `map_err`.
    pub(super) fn reading(file: &str) -> impl FnOnce(io::Error) -> Self {
        let file = file.to_owned();
        move |error| match error.downcast::<Self>() {
            Ok(error) => error,
            Err(source) => Self::System { file, action: "read the samples", source },
        }
    }

    /// True if the reader of a pipe went away, which ends a stream quietly.
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::System { source, .. } if source.kind() == io::ErrorKind::BrokenPipe)
    }
}
