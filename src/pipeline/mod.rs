//! Runs a bank on recordings or streams and writes its outputs. `hybank fuse` and `hybank stream` share
//! this module.
//!
//! ```text
//! MultiReader -> GapFiller -> runtime::Stream -> latency skip -> Output (samples and mask)
//! ```
//!
//! A [`Pipeline`] takes frames as they arrive. It fills missing samples, runs the bank, drops the latency,
//! and passes encoded samples to an [`Output`], with a mask of the samples that missing inputs affect.
//! [`run`] processes all frames of a [`MultiReader`](crate::io::MultiReader). The result is an [`Outcome`]
//! with counts and [`Warning`]s; nothing is printed. A [`Retuner`] changes the filters on the way. [`fuse`]
//! does the same with a signal that is in memory.

mod complex;
mod error;
mod gap;
mod gaps;
mod mask;
mod outcome;
mod outputs;
mod peak;
mod retune;
mod run;
mod shifted;
mod stage;
mod streams;
mod touch;
mod whole;

pub use error::PipelineError;
pub use gap::Gap;
pub use gaps::{GapFiller, GapPolicy};
pub use outcome::{GapSummary, Outcome, Warning};
pub use outputs::{Block, FileOutputs, Output};
pub use retune::{Retuned, Retuner, Retuning};
pub use run::{Ending, run};
pub use streams::{Pipeline, Settings};
pub use whole::{Whole, WholeSettings, fuse, fuse_until};
