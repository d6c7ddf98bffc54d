//! Errors of a pipeline.

use crate::files::FileError;
use crate::io::IoError;
use crate::runtime::{BuildError, ProcessError};

/// An error of one of the stages.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The bank's parts do not fit together.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The frames do not fit the bank.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// An input cannot be read, or an output written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// An output file cannot be created or renamed to its final name.
    #[error(transparent)]
    File(#[from] FileError),
}

impl PipelineError {
    /// True if the reader of an output pipe went away, which ends a stream quietly.
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Io(error) if error.is_closed_pipe())
    }
}
