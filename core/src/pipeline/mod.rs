//! Runs a bank on recordings, streams or signals in memory.
//!
//! ```text
//! Input -> missing samples estimated -> runtime::Stream -> latency dropped -> runtime::FrameSink
//! ```
//!
//! One loop (`fusion`) estimates missing samples, runs the bank, drops the latency, and marks the samples
//! that missing inputs affect. A [`GapEstimator`] knows how samples hang together, so this room computes no
//! covariances. A [`Pipeline`] runs the loop on frames as they arrive and hands over encoded samples, for
//! example to [`FileOutputs`]. [`fuse`] runs it on a signal in memory. Complex samples are two streams over
//! the same frames; a sample with one part missing is missing. The result is an [`Outcome`] with counts and
//! [`Warning`]s; nothing is printed.
//!
//! ```
//! use hybank_core::bank::{Bank, SynthesisFilters};
//! use hybank_core::io::{PcmFormat, PcmFrames, SampleLayout};
//! use hybank_core::pipeline::{Block, Pipeline, Settings};
//! // Two time-interleaved converters.
//! let bank = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0, 0.0], vec![0.0, 1.0]]), 2);
//! let plan = bank.plan(Default::default())?;
//! let mut pipeline = Pipeline::new(&bank, &plan, Settings::default(), PcmFormat::S16Le, false);
//! let mut output = Vec::new();
//! for frame in [[1, 2], [3, 4]].map(|frame: [i16; 2]| frame.map(i16::to_le_bytes).concat()) {
//!     let layout = SampleLayout::packed(PcmFormat::S16Le);
//!     let recording = PcmFrames { layout, channels: 2, bytes: &frame };
//!     let mut write = |block: Block<'_>| Ok(output.extend_from_slice(block.samples));
//!     pipeline.push_parts(&[&recording], &mut write)?;
//! }
//! assert_eq!(output, [1, 0, 2, 0, 3, 0, 4, 0]);
//! assert_eq!(pipeline.finish().samples, 4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cost;
mod fusion;
mod gaps;
pub mod matching;
mod offline;
mod outcome;
mod outputs;
mod state;
mod streaming;

pub use fusion::{DroppedLatency, Settings};
pub use gaps::{Gap, GapEstimate, GapEstimator, GapSummary, LISTED_GAPS};
pub use offline::{fuse, fused};
pub use outcome::{Outcome, PipelineError, Warning};
pub use outputs::FileOutputs;
pub use streaming::{Block, Pipeline};
