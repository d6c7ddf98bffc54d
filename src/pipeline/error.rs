//! Errors of a pipeline.

use crate::files::FileError;
use crate::io::IoError;
use crate::runtime::{BuildError, ProcessError, SwapError};

/// An error of one of the stages.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// The bank's parts do not fit together.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The frames do not fit the bank.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A stream cannot go on with other filters.
    #[error(transparent)]
    Swap(#[from] SwapError),
    /// An input cannot be read, or an output written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// An output file cannot be created or renamed to its final name.
    #[error(transparent)]
    File(#[from] FileError),
    /// The thread that prepares changes of the filters cannot be started.
    #[error("no thread for the changes of the filters: {0}")]
    Thread(std::io::Error),
    /// The thread that prepares changes of the filters ended before its work was done.
    #[error("the thread that follows the delays has died; the outputs would be those of old delays")]
    RetunerDied,
    /// Filters cannot change for complex samples.
    #[error("delays are measured in real samples; these are complex")]
    RetunedComplex,
    /// The caller of [`fuse`](super::fuse) stopped it.
    #[error("the fusion was stopped")]
    Stopped,
}

impl PipelineError {
    /// True if the reader of an output pipe went away, which ends a stream quietly.
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Io(error) if error.is_closed_pipe())
    }
}
