//! Errors of reading and writing whole files.

use std::io;

/// A fault of a file; every sentence names the file, the reason and, where there is one, the remedy.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The operating system refused.
    #[error("{file}: cannot {action}: {source}")]
    System {
        /// Name of the file.
        file: String,
        /// The action that failed, as an imperative phrase: `open it`.
        action: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// The output exists, or appeared while it was being written, and was not to be replaced.
    #[error("{file}: the file exists; give another name, or allow it to be replaced")]
    Exists {
        /// Name of the file.
        file: String,
    },
    /// The output is not a plain file and must not be replaced by one.
    #[error("{file}: cannot replace it: it is {what}")]
    NotAFile {
        /// Name of the file.
        file: String,
        /// What it is, and the remedy.
        what: &'static str,
    },
    /// An output is also an input.
    #[error("{output}: it is also the input {input}; give the output another name")]
    InputIsOutput {
        /// Name of the output.
        output: String,
        /// Name of the input.
        input: String,
    },
    /// Two outputs are one file.
    #[error("{first} and {second} are the same file; give the outputs different names")]
    SameOutput {
        /// Name of one output.
        first: String,
        /// Name of the other.
        second: String,
    },
    /// The file is longer than its kind may be.
    #[error("{file}: longer than {most} bytes, the most that {kind} may have; {remedy}")]
    TooLong {
        /// Name of the file.
        file: String,
        /// The bound in bytes.
        most: u64,
        /// The kind of file, with its article.
        kind: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// A text that is not UTF-8.
    #[error("{file}: byte {offset} is not UTF-8, so this is no text file; give the file that was meant")]
    NotText {
        /// Name of the file.
        file: String,
        /// The first byte that does not fit.
        offset: usize,
    },
}

impl FileError {
    /// Wraps the system's refusal; for use with `map_err`.
    pub fn system(file: &str, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        let file = file.to_owned();
        move |source| Self::System { file, action, source }
    }
}
