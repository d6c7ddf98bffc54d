//! Runs a bank on recordings, streams or signals in memory.
//!
//! ```text
//! Input -> GapFiller -> runtime::Stream -> latency dropped -> runtime::Output (samples and mask)
//! ```
//!
//! One loop (`fusion`) fills missing samples, runs the bank, drops the latency, and marks the samples that
//! missing inputs affect. A [`Pipeline`] runs it on frames as they arrive and hands over encoded samples,
//! for example to [`FileOutputs`]; a [`Retuner`] changes its filters on the way. [`fuse`] runs it on a
//! signal in memory. Complex samples are two streams over the same frames; a sample with one part missing
//! is missing. The result is an [`Outcome`] with counts and [`Warning`]s; nothing is printed.

mod fusion;
mod gaps;
pub mod matching;
mod offline;
mod outcome;
mod outputs;
mod retune;
mod streaming;

pub use fusion::{DroppedLatency, Settings};
pub use gaps::{Gap, GapPolicy, GapSummary, LISTED_GAPS};
pub use offline::{fuse, fused};
pub use outcome::{Outcome, PipelineError, Warning};
pub use outputs::FileOutputs;
pub use retune::{Change, Retuner};
pub use streaming::{Block, Pipeline};
