//! The result of a run.

use super::GapSummary;
use crate::io::InputWarning;
use crate::runtime::PlanSummary;
use std::fmt;

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
    /// Missing samples, if they were to be filled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaps: Option<GapSummary>,
    /// One byte per output sample, 1 if a missing input affects it, if gaps were to be filled by
    /// [`fuse`](super::fuse). A [`Pipeline`](super::Pipeline) hands the mask over with its samples.
    #[serde(skip)]
    pub mask: Option<Vec<u8>>,
}

/// A fault that was tolerated.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// A fault of an input.
    Input(InputWarning),
    /// The inputs of these names have no frames.
    Empty(Vec<String>),
    /// This many input samples were NaN or infinite.
    Replaced(u64),
    /// This many output samples saturated.
    Clipped(u64),
    /// A recursion's state was not finite this many times.
    StateReset(u64),
}

impl Outcome {
    /// The faults that the filters tolerated.
    pub fn warnings(&self) -> impl Iterator<Item = Warning> + use<> {
        let counted = |count: u64, warning: fn(u64) -> Warning| (count > 0).then(|| warning(count));
        let replaced = counted(self.replaced, Warning::Replaced);
        let clipped = counted(self.clipped, Warning::Clipped);
        [replaced, clipped, counted(self.state_resets, Warning::StateReset)].into_iter().flatten()
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(warning) => warning.fmt(f),
            Self::Empty(inputs) => {
                let inputs = inputs.join(", ");
                write!(f, "{inputs}: no samples to fuse (the length is zero), so the output has none")
            }
            Self::Replaced(1) => {
                f.write_str("1 input sample was missing, NaN or infinite and was replaced by 0")
            }
            Self::Replaced(count) => {
                write!(f, "{count} input samples were missing, NaN or infinite and were replaced by 0")
            }
            Self::Clipped(1) => f.write_str("1 output sample was clipped"),
            Self::Clipped(count) => write!(f, "{count} output samples were clipped"),
            Self::StateReset(1) => f.write_str("once the filter state was not finite and was set to zero"),
            Self::StateReset(count) => {
                write!(f, "{count} times the filter state was not finite and was set to zero")
            }
        }
    }
}
