//! Running a bank: kernels, reconstructor, pipeline. No allocation on the hot path, no design code.
//!
//! A *tick* is one slow period: N samples in, M samples out.

mod aligned;
mod error;
mod fast_fir;
mod fir;
mod fir_bank;
mod form;
mod overlap_save;
mod reconstructor;
mod sample;
mod simd;
mod state_space;
mod structure;
#[cfg(test)]
mod tests;
mod ticks;
mod window;
mod workers;

pub use error::{BuildError, ProcessError};
pub use form::Form;
pub use reconstructor::{Options, PlanSummary, Precision, Reconstructor};
pub use simd::{Isa, multiply_add_chains};
pub use ticks::PcmOutput;
pub use workers::Workers;
