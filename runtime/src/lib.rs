#![doc = include_str!("../README.md")]
//!
//! Samples need not be interleaved: [`Stream::run`] takes any [`FrameSource`] and gives to any
//! [`FrameSink`], such as a slice per channel ([`Planar`]) and recordings as they lie in files
//! ([`PcmFrames`], [`PcmOutput`]). Complex samples (IQ) are two streams through one plan, one for the real
//! parts and one for the imaginary ones, which [`PcmFrames::part`] and `PcmOutput::part` pick out by a
//! stride.
//!
//! ```
//! use hybank_runtime::{Options, PcmFormat, PcmFrames, PcmOutput, Planar, Plan, SampleLayout, Stream};
//!
//! let taps = [vec![0.5, 1.0, 0.5, 0.0], vec![0.0, 0.5, 1.0, 0.5]];
//! let plan = Plan::from_taps(&taps, 2, 1, Options::default())?;
//! // A slice per channel, and 16-bit samples out.
//! let channels: [&[f32]; 2] = [&[0.25, 0.5, -0.5], &[0.125, 0.0, 0.25]];
//! let mut bytes = [0; 12];
//! let mut output = PcmOutput::packed(PcmFormat::S16Le, &mut bytes);
//! Stream::new(&plan).run(&Planar::new(&channels)?, &mut output)?;
//! assert_eq!(output.clipped, 0);
//!
//! // The same frames as they lie in a recording.
//! let frames = [0.25f32, 0.125, 0.5, 0.0, -0.5, 0.25].map(f32::to_le_bytes).concat();
//! let layout = SampleLayout::packed(PcmFormat::F32Le);
//! let recording = PcmFrames { layout, channels: 2, bytes: &frames };
//! let mut again = [0; 12];
//! Stream::new(&plan).run(&recording, &mut PcmOutput::packed(PcmFormat::S16Le, &mut again))?;
//! assert_eq!(again, bytes);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | [`Algorithm`] | latency | work per output sample | [`history`](Plan::history) |
//! |---|---|---|---|
//! | `direct` | none added | N K multiply-adds | K - 1 frames |
//! | `overlap-save` | a batch of frames | O(N log K) | K - 1 |
//! | recursive (`parallel-form`, `dense`) | none added | by the order | for ever |
//!
//! K = ceil(taps / M) is the number of taps per phase.
#![cfg_attr(docsrs, feature(doc_cfg))]

mod adapters;
mod algorithms;
mod aligned;
mod engine;
mod error;
mod history;
#[cfg(feature = "rayon")]
mod parallel;
mod pcm;
mod plan;
mod sample;
mod simd;
mod state;
mod stream;

pub use adapters::{
    FrameSink, FrameSource, Frames, Halves, Interleaved, Nonlinearity, PcmOutput, Planar, SideBySide,
    SplitOutput, Zeros,
};
pub use algorithms::choice::{Algorithm, ParseAlgorithmError, Precision};
pub use algorithms::recursive::{DelayLines, DelayedInput, StateMatrices};
pub use error::{BuildError, ProcessError, StateError};
#[cfg(feature = "rayon")]
pub use parallel::ThreadPool;
pub use pcm::{ParsePcmFormatError, PcmFormat, PcmFrames, SampleLayout};
pub use plan::{Options, Plan, PlanSummary};
pub use sample::{Sample, Shape};
pub use simd::Isa;
pub use simd::multiply_add_chains;
pub use state::STATE_COUNTS;
pub use stream::Stream;

#[cfg(test)]
mod tests;
