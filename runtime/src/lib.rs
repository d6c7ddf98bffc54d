//! Runs hybrid multirate filter banks: N slow streams in, one stream M times as fast out.
//!
//! Frame k of the input is one sample of each of N channels, x_1\[k\] .. x_N\[k\], taken in one slow period.
//! Each frame gives M output samples, p = 0..M - 1:
//!
//! ```text
//! y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j]          FIR: taps f_i[n] at the fast rate
//! s[k + 1] = a s[k] + b x[k],  y[kM..] = c s[k] + d x[k]  recursive: a state space, one step per frame
//! ```
//!
//! A [`Plan`] holds the coefficients in the order in which the kernels use them, and never changes; a
//! [`Stream`] is a plan with the state of one stream. Its calls allocate nothing, lock nothing, and give the
//! same bits however the frames are cut into calls and whatever the instruction set.
//!
//! ```
//! use hybank_runtime::{Options, Plan, Stream};
//!
//! // N = 2 channels, 4 taps each at the fast rate, M = 2, designed to be m0 = 1 output sample late.
//! let taps = [vec![0.5, 1.0, 0.5, 0.0], vec![0.0, 0.5, 1.0, 0.5]];
//! let plan = Plan::from_taps(&taps, 2, 1, Options::default())?;
//! let mut stream = Stream::new(&plan);
//!
//! let input = [1.0f32, 0.0, 0.0, 1.0, 0.0, 0.0];      // three frames: x_1[0], x_2[0], x_1[1], ..
//! let mut output = [0.0f32; 6];                        // M samples per frame
//! let written = stream.process(&input, &mut output)?;
//! assert_eq!((written, plan.latency()), (6, 1));       // output sample n is due at fast sample n - 1
//! assert_eq!(output, [0.5, 1.0, 0.5, 0.5, 1.0, 0.5]);
//!
//! let mut tail = vec![0.0f32; plan.flush_frames() * plan.ratio()];
//! stream.flush(&mut tail[..])?;                        // the last samples, after the end of the input
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Samples need not be interleaved: [`Stream::run`] takes any [`Input`] and gives to any [`Output`], such as
//! a slice per channel ([`Planar`]) and recordings as they lie in files ([`PcmFrames`], [`PcmOutput`]).
//! Complex samples (IQ) are two streams through one plan, one for the real parts and one for the imaginary
//! ones, which [`PcmFrames::part`] and `PcmOutput::part` pick out by a stride.
//!
//! | [`Algorithm`] | latency | work per output sample | [`history`](Plan::history) |
//! |---|---|---|---|
//! | `direct` | none added | N K multiply-adds | K - 1 frames |
//! | `overlap-save` | a batch of frames | O(N log K) | K - 1 |
//! | recursive (`parallel-form`, `dense`) | none added | by the order | for ever |
//!
//! K = ceil(taps / M) is the number of taps per phase.

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
#[cfg(test)]
mod tests;
#[cfg(feature = "rayon")]
mod thread_pool;

pub use adapters::{Frames, Input, Interleaved, Output, PcmOutput, Planar, SplitOutput, Zeros};
pub use algorithms::choice::{Algorithm, ParseAlgorithmError, Precision};
pub use algorithms::recursive::StateSpace;
pub use error::{BuildError, ProcessError, StateError, SwapError};
pub use pcm::{ParsePcmFormatError, PcmFormat, PcmFrames, SampleLayout};
pub use plan::{Options, Plan, PlanSummary};
pub use sample::Sample;
pub use simd::Isa;
#[doc(hidden)]
pub use simd::multiply_add_chains;
#[doc(hidden)]
pub use state::STATE_COUNTS;
pub use stream::Stream;
#[cfg(feature = "rayon")]
pub use thread_pool::ThreadPool;
