//! From recordings to a running bank and on to its outputs: what `hybank fuse` and `hybank stream` share.
//!
//! ```text
//! MultiReader -> GapFiller -> runtime::Stream -> latency skip -> Output (samples and mask)
//! ```
//!
//! A [`Pipeline`] takes frames as they arrive, fills what is missing, runs the bank, drops the latency, and hands encoded
//! samples to an [`Output`] together with a mask of the samples that missing inputs affect. [`run`] does that for all frames
//! of a [`MultiReader`](crate::io::MultiReader). What happened is an [`Outcome`] of counts and [`Warning`]s; nothing is
//! printed.

mod error;
mod gap;
mod gaps;
mod mask;
mod outcome;
mod outputs;
mod run;
mod stage;
mod touch;

pub use error::PipelineError;
pub use gap::Gap;
pub use gaps::{GapFiller, GapPolicy};
pub use outcome::{GapSummary, Outcome, Warning};
pub use outputs::{Block, FileOutputs, Output};
pub use run::{Ending, run};
pub use stage::{Pipeline, Settings};
