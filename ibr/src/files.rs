//! Reading input files: whole, up to a size limit since a device may never end, and what is wrong with them.

use hybank::files::{self, Bound, FileError, read_bytes};
use hybank::memory::check_memory;
use hybank::messages::Quoted;
use std::fmt;
use std::path::{Path, PathBuf};

/// What to do about a path in a scene that cannot be opened.
pub(crate) const CHECK_THE_PATH: &str = "check the path (paths in a scene are relative to the scene file)";

const IMAGE: Bound = Bound { bytes: 1 << 30, kind: "an image or map", remedy: "shrink it" };
const TEXT: Bound = Bound { bytes: 1 << 28, kind: "a text file", remedy: "is it the right file?" };

/// What is wrong with an input file: a scene, tracks, cameras, images or maps.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// It cannot be read.
    #[error("{source}; {remedy}")]
    Read {
        /// The reason, with the name of the file.
        source: FileError,
        /// What to do about it.
        remedy: &'static str,
    },
    /// Its content cannot be used.
    #[error("{}{at}: {reason}", Quoted(path))]
    Content {
        /// The file.
        path: PathBuf,
        /// Where in the file.
        at: Location,
        /// What is wrong, and the remedy.
        reason: String,
    },
}

/// Where in a file something is wrong; lines, records and frames are counted from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// In all of it.
    File,
    /// In a line.
    Line(usize),
    /// In a line and a column of it.
    Column(usize, usize),
    /// In a record of a binary file.
    Record(usize),
    /// In a frame of transforms.json, with the name of its image.
    Frame(usize, String),
    /// In the camera of an image.
    Image(String),
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, ":{line}"),
            Self::Column(line, column) => write!(f, ":{line}:{column}"),
            Self::Record(record) => write!(f, ": record {record}"),
            Self::Frame(frame, image) => write!(f, ": frame {frame} (\"{}\")", Quoted(image)),
            Self::Image(image) => write!(f, ": image \"{}\"", Quoted(image)),
        }
    }
}

impl InputError {
    pub(crate) fn content(path: &Path, at: Location, reason: impl ToString) -> Self {
        Self::Content { path: path.into(), at, reason: reason.to_string() }
    }
}

/// The bytes of a file.
pub(crate) fn read(path: &Path, remedy: &'static str) -> Result<Vec<u8>, InputError> {
    read_bytes(path, IMAGE).map_err(|source| InputError::Read { source, remedy })
}

/// The bytes of a file, if there is `room` for what is made of them, in bytes.
pub(crate) fn read_with_room(
    path: &Path,
    remedy: &'static str,
    room: impl Fn(&[u8]) -> f64,
) -> Result<Vec<u8>, InputError> {
    let bytes = read(path, remedy)?;
    refuse_without_memory(path, room(&bytes)).map(|()| bytes)
}

/// The text of a file, if there is `room` for what is made of it, in bytes.
pub(crate) fn read_text(
    path: &Path,
    remedy: &'static str,
    room: impl Fn(&str) -> f64,
) -> Result<String, InputError> {
    let text = files::read_text(path, TEXT).map_err(|source| InputError::Read { source, remedy })?;
    refuse_without_memory(path, room(&text)).map(|()| text)
}

/// Refuses a file that takes more memory, in bytes, than this process may use.
pub(crate) fn refuse_without_memory(path: &Path, bytes: f64) -> Result<(), InputError> {
    let refused = |shortage| format!("to read it takes {shortage}; is it the right file?");
    check_memory(bytes).map_err(|shortage| InputError::content(path, Location::File, refused(shortage)))
}

/// The text of a stream called `name`.
#[cfg(feature = "cli")]
pub(crate) fn text(stream: impl std::io::Read, name: &str) -> Result<String, FileError> {
    files::text_in(files::bytes_of(stream, name, TEXT)?, name)
}
