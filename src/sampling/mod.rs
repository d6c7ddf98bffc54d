//! The sampling core that both crates stand on.
//!
//! * `kernel`: centred B-splines of odd degree, with slopes;
//! * [`fit`]: regularised, weighted least squares in a shift-invariant spline space, solved in O(M n^2);
//! * `fit2`: the same for images, with tensor products (feature `fit2`);
//! * `recurrent`: perfect reconstruction from M interleaved sample sets (Yen's formula);
//! * [`nonuniform`]: samples with value errors and jitter;
//! * `smoothing`: smoothing splines through such samples, with what is known between them.
//!
//! Unit spacing and f64 throughout, f32 in `fit2`; no dependency beyond the standard library, and rayon in
//! `fit2`.

mod error;
pub mod fit;
#[cfg(feature = "fit2")]
pub mod fit2;
mod kernel;
pub mod nonuniform;
#[cfg(feature = "design")]
mod recurrent;
#[cfg(feature = "design")]
mod smoothing;

pub use error::SamplingError;
pub use fit::{Fit, FitSample};
#[cfg(feature = "fit2")]
pub use fit2::Fit2;
#[cfg(feature = "design")]
pub(crate) use recurrent::Recurrent;
#[cfg(feature = "design")]
pub(crate) use smoothing::SmoothingSpline;
