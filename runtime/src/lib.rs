//! Running a bank: kernels, plans and streams. No allocation on the hot path, no design code, no files.
//!
//! A *tick* is one slow period: N samples in, M samples out.

mod aligned;
mod error;
mod fast_fir;
mod fir;
mod fir_bank;
mod form;
mod overlap_save;
mod pcm;
mod pcm_frames;
mod plan;
mod sample;
mod simd;
mod state_space;
mod stream;
mod structure;
#[cfg(test)]
mod tests;
mod ticks;
mod window;
#[cfg(feature = "rayon")]
mod workers;

pub use error::{BuildError, ProcessError};
pub use form::Form;
pub use pcm::{ParsePcmFormatError, PcmFormat};
pub use pcm_frames::{PcmFrames, SampleLayout};
pub use plan::{Options, Plan, PlanSummary, Precision, StateSpace};
pub use simd::{Isa, multiply_add_chains};
pub use stream::Stream;
pub use ticks::PcmOutput;
#[cfg(feature = "rayon")]
pub use workers::Workers;
