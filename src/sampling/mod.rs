//! The sampling core that both crates stand on.
//!
//! * [`kernel`]: centred B-splines of any degree and the sinc, with slopes;
//! * [`fit`]: regularised, weighted least squares in a shift-invariant spline space, solved in O(M n^2);
//! * `fit2`: the same for images, with tensor products (feature `fit2`);
//! * [`recurrent`]: perfect reconstruction from M interleaved sample sets (Yen's formula);
//! * [`nonuniform`]: samples with value errors and jitter, and sure bounds of the error between them;
//! * [`smoothing`]: smoothing splines through such samples, with what is known between them;
//! * [`periodic`]: superposed periodic sets, as several cameras or converters take them, and the moments of
//!   the intervals between their samples;
//! * [`jump`]: the error of linear interpolation across a jump;
//! * [`delaunay`]: the moments of the triangles between samples of a plane.
//!
//! Unit spacing and f64 throughout, f32 in `fit2`; no dependency beyond the standard library, and rayon in
//! `fit2`.

pub mod delaunay;
mod error;
pub mod fit;
#[cfg(feature = "fit2")]
pub mod fit2;
pub mod jump;
pub mod kernel;
pub mod nonuniform;
pub mod periodic;
mod quadrature;
pub mod recurrent;
pub mod smoothing;

pub use error::SamplingError;
pub use fit::{Fit, FitSample};
#[cfg(feature = "fit2")]
pub use fit2::Fit2;
pub use kernel::{BSpline, sinc, sinc_slope};
pub use periodic::PeriodicSets;
pub use recurrent::Recurrent;
pub use smoothing::SmoothingSpline;
