//! Errors of reading and writing whole files.

use crate::messages::Quoted;
use std::io;

/// A fault of a file; every sentence names the file, the reason and, where there is one, the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The operating system refused.
    #[error("{}: cannot {action}: {}", Quoted(.file), reason(action, .source))]
    System {
        /// Name of the file.
        file: String,
        /// The action that failed, as an imperative phrase: `open it`.
        action: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// The output exists, or appeared while it was being written, and was not to be replaced.
    #[error("{}: the file exists; give another name, or allow it to be replaced", Quoted(.file))]
    Exists {
        /// Name of the file.
        file: String,
    },
    /// The output is a folder or a link to nothing, and must not be replaced by a file.
    #[error("{}: cannot replace it: it is {what}", Quoted(.file))]
    NotAFile {
        /// Name of the file.
        file: String,
        /// What it is, and the remedy.
        what: &'static str,
    },
    /// A device, pipe or socket, whose place no finished file can take.
    #[error("{}: cannot replace it: it is a device, pipe or socket; give the name of a file", Quoted(.file))]
    Special {
        /// Name of the output.
        file: String,
    },
    /// A set of outputs of which some have their names and others get none.
    #[error("{error}; already in place: {}", .named.join(" and "))]
    InPart {
        /// Why the set is not complete.
        error: Box<FileError>,
        /// The outputs that are there, each whole, as text that may be printed.
        named: Vec<String>,
    },
    /// An output is also an input.
    #[error("{}: it is also the input {}; give the output another name", Quoted(.output), Quoted(.input))]
    InputIsOutput {
        /// Name of the output.
        output: String,
        /// Name of the input.
        input: String,
    },
    /// Two outputs are one file.
    #[error("{} and {} are the same file; give the outputs different names", Quoted(.first), Quoted(.second))]
    SameOutput {
        /// Name of one output.
        first: String,
        /// Name of the other.
        second: String,
    },
    /// The file is longer than its kind may be.
    #[error("{}: longer than {most} bytes, the most that {kind} may have; {remedy}", Quoted(.file))]
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
    #[error("{}: byte {offset} is not UTF-8, so this is no text file; give the file that was meant", Quoted(.file))]
    NotText {
        /// Name of the file.
        file: String,
        /// The first byte that does not fit.
        offset: usize,
    },
}

/// The system's reason; its words for folders do not say that they are about these.
fn reason(action: &str, source: &io::Error) -> String {
    match source.kind() {
        io::ErrorKind::IsADirectory => "it is a folder; give the name of a file".into(),
        io::ErrorKind::NotFound if action == CREATE => {
            "its folder is not there or takes no files; make the folder, or give another name".into()
        }
        _ => source.to_string(),
    }
}

/// The action that begins an output.
pub(super) const CREATE: &str = "create it";

impl FileError {
    /// Wraps the system's refusal; for use with `map_err`.
    pub fn system(file: &str, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        let file = file.to_owned();
        move |source| Self::System { file, action, source }
    }

    /// The same error of a set of which these outputs have their names.
    pub(super) fn after<'a>(self, named: impl Iterator<Item = &'a str>) -> Self {
        let named: Vec<String> = named.map(|name| Quoted(name).to_string()).collect();
        if named.is_empty() { self } else { Self::InPart { error: Box::new(self), named } }
    }
}
