//! The result of a run, or its error.

use super::GapSummary;
use crate::files::FileError;
use crate::io::{InputWarning, IoError};
use crate::messages::counted;
use crate::runtime::{BuildError, PlanSummary, ProcessError};

/// Counts and settings of a finished run.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Outcome {
    /// The plan with which the bank ran.
    pub plan: PlanSummary,
    /// N.
    pub channels: usize,
    /// M.
    pub ratio: usize,
    /// Output samples.
    pub samples: u64,
    /// Output samples that a [`Pipeline`](super::Pipeline) had to saturate.
    pub clipped: u64,
    /// Input samples that were NaN or infinite and became 0.
    pub replaced: u64,
    /// Times that a recursion's state was not finite and was set to zero.
    pub state_resets: u64,
    /// Missing samples, if they were to be estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaps: Option<GapSummary>,
    /// The mask of [`Block`](super::Block), if missing samples were to be estimated by
    /// [`fuse`](super::fuse). A [`Pipeline`](super::Pipeline) hands the mask over with its samples.
    #[serde(skip)]
    pub mask: Option<Vec<u8>>,
}

/// A fault that was tolerated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Warning {
    /// A fault of an input.
    #[error(transparent)]
    Input(InputWarning),
    /// The inputs of these names have no frames.
    #[error("{}: no samples to fuse (the length is zero), so the output has none", .0.join(", "))]
    Empty(Vec<String>),
    /// This many input samples were NaN or infinite.
    #[error("{} {were} missing, NaN or infinite and {were} replaced by 0", counted(.0, "input sample"), were = were(*.0))]
    Replaced(u64),
    /// This many output samples saturated.
    #[error("{} {} clipped", counted(.0, "output sample"), were(*.0))]
    Clipped(u64),
    /// A recursion's state was not finite this many times.
    #[error("{} the filter state was not finite and was set to zero", if *.0 == 1 { "once".to_owned() } else { format!("{} times", .0) })]
    StateReset(u64),
}

fn were(count: u64) -> &'static str {
    if count == 1 { "was" } else { "were" }
}

impl Outcome {
    /// The faults that the filters tolerated.
    pub fn warnings(&self) -> impl Iterator<Item = Warning> + use<> {
        let any = |count: u64, warning: fn(u64) -> Warning| (count > 0).then(|| warning(count));
        let replaced = any(self.replaced, Warning::Replaced);
        let clipped = any(self.clipped, Warning::Clipped);
        [replaced, clipped, any(self.state_resets, Warning::StateReset)].into_iter().flatten()
    }
}

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
    /// An input cannot be read, or an output written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// An output file cannot be created or renamed to its final name.
    #[error(transparent)]
    File(#[from] FileError),
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
