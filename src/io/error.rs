//! Errors of reading and writing samples.

use crate::files::FileError;
use std::io;

/// A fault of a file or stream; every sentence names the file, the place, the rule and the remedy.
#[derive(Debug, thiserror::Error)]
pub enum IoError {
    /// The operating system refused, or a file could not be read or written as a whole.
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
    /// The first bytes are not those of a WAV file.
    #[error(
        "{file}: not a WAV file (byte 0 holds {found}, where RIFF, RF64 or BW64 is expected); raw samples need a format name such as f32le"
    )]
    NotWav {
        /// Name of the file.
        file: String,
        /// The bytes found, printable.
        found: String,
    },
    /// A file that is not of its kind, or holds no samples that can be read.
    #[error("{file}: not {kind} that can be read: {problem}")]
    Malformed {
        /// Name of the file.
        file: String,
        /// What its name says that it is, with its article.
        kind: &'static str,
        /// Place, reason and remedy.
        problem: String,
    },
    /// Inputs that do not fit the settings, one another, or the output.
    #[error("{file}: {problem}")]
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

/// For readers of bytes whose errors say more; [`IoError::reading`] takes them back.
impl From<IoError> for io::Error {
    fn from(error: IoError) -> Self {
        Self::other(error)
    }
}
