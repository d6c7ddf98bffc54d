//! Reading input files: whole, up to a size limit since a device may never end, and what is wrong with
//! files.

use hybank_core::files::{self, Bound, FileError};
use hybank_core::messages::Quoted;
use std::path::{Path, PathBuf};

/// What to do about a path in a scene that cannot be opened.
pub(crate) const CHECK_THE_PATH: &str = "check the path (paths in a scene are relative to the scene file)";

const IMAGE: Bound = Bound { bytes: 1 << 30, kind: "an image or map", remedy: "shrink it" };
const TEXT: Bound = Bound { bytes: 1 << 28, kind: "a text file", remedy: "is it the right file?" };
const SCENE: Bound = Bound { bytes: 1 << 24, kind: "a scene file", remedy: "is it the right file?" };

/// What is wrong with a file (a scene, tracks, cameras, images or maps), or with images that do not fit.
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
        /// Where in the file, from 1: `:7` (a line), `:7:3` (with its column), `: record 7`, or an image.
        at: String,
        /// What is wrong, and the remedy.
        reason: String,
    },
    /// It cannot be written, or the reason why it cannot be read has its own remedy.
    #[error(transparent)]
    File(#[from] FileError),
    /// Two images that belong together differ in size.
    #[error("{left} has {} x {} pixels and {right} has {} x {}: they must agree", sizes[0].0, sizes[0].1, sizes[1].0, sizes[1].1)]
    Sizes {
        /// Name of the first image.
        left: String,
        /// Name of the second image.
        right: String,
        /// Width and height of both.
        sizes: [(usize, usize); 2],
    },
    /// A buffer that does not hold width * height * channels values.
    #[error("{width} x {height} pixels of {channels} channels need {expected} values, {given} were given")]
    Buffer {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Channels, 1 or 3.
        channels: usize,
        /// Values needed.
        expected: usize,
        /// Values given.
        given: usize,
    },
}

impl InputError {
    pub(crate) fn content(path: &Path, at: String, reason: impl ToString) -> Self {
        Self::Content { path: path.into(), at, reason: reason.to_string() }
    }

    /// That all of a file cannot be used, or not be written.
    pub(crate) fn file(path: &Path, reason: impl ToString) -> Self {
        Self::content(path, String::new(), reason)
    }
}

/// The bytes of a file.
pub(crate) fn read_bytes(path: &Path, remedy: &'static str) -> Result<Vec<u8>, InputError> {
    files::read_bytes(path, IMAGE).map_err(|source| unread(source, remedy))
}

/// The text of a file.
pub(crate) fn read_text(path: &Path, remedy: &'static str) -> Result<String, InputError> {
    files::read_text(path, TEXT).map_err(|source| unread(source, remedy))
}

/// Why a file cannot be read; the remedy is for what the system refuses.
fn unread(source: FileError, remedy: &'static str) -> InputError {
    match source {
        FileError::System { .. } => InputError::Read { source, remedy },
        other => InputError::File(other),
    }
}

/// The text of a scene file.
pub(crate) fn read_scene(path: &Path) -> Result<String, InputError> {
    files::read_text(path, SCENE).map_err(|source| unread(source, "check the path"))
}

/// The text of a scene from a stream called `name`.
pub(crate) fn text(stream: impl std::io::Read, name: &str) -> Result<String, FileError> {
    files::text_in(files::bytes_of(stream, name, SCENE)?, name)
}
