//! The sampling core that both crates stand on: kernels, fits in shift-invariant spaces, nonuniform samples.

mod error;
pub mod kernel;
pub mod recurrent;

pub use error::SamplingError;
pub use kernel::{BSpline, sinc, sinc_slope};
pub use recurrent::Recurrent;
