//! Errors of the files that describe cameras.

use super::CameraError;
use std::path::PathBuf;

/// What to do about a path in a scene that cannot be opened.
pub(super) const CHECK_THE_PATH: &str = "check the path (paths in a scene are relative to the scene file)";

/// Errors of a COLMAP model, of transforms.json and of calib.txt.
#[derive(Debug, thiserror::Error)]
pub enum CameraFileError {
    /// A file cannot be opened.
    #[error("{}: {source}; {remedy}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
        /// What to do about it.
        remedy: &'static str,
    },
    /// A line that does not follow the format.
    #[error("{}:{line}: {reason}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// A record of a binary file that does not follow the format.
    #[error("{}: record {record}: {reason}", path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// The record, from 1.
        record: usize,
        /// What is wrong.
        reason: String,
    },
    /// A frame of transforms.json that cannot be used.
    #[error("{}: frame {frame} ({image:?}): {reason}", path.display())]
    Frame {
        /// The file.
        path: PathBuf,
        /// The frame, from 1.
        frame: usize,
        /// Its `file_path`.
        image: String,
        /// What is wrong.
        reason: String,
    },
    /// Something is missing, contradicts itself or is not of the format at all.
    #[error("{}: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is missing or wrong.
        reason: String,
    },
    /// A camera that cannot be used.
    #[error("{}: image {image:?}: {source}", path.display())]
    Camera {
        /// The file.
        path: PathBuf,
        /// The image.
        image: String,
        /// What is wrong with it.
        source: CameraError,
    },
}
