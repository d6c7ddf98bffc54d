//! The sampling core that both crates stand on.
//!
//! * [`kernel`]: centred B-splines of any degree and the sinc, with slopes;
//! * [`fit`]: regularised, weighted least squares in a shift-invariant spline space, solved in O(M n^2);
//! * [`recurrent`]: perfect reconstruction from M interleaved sample sets (Yen's formula);
//! * [`nonuniform`]: samples with value errors and jitter, error bounds, interval moments.
//!
//! Unit spacing and f64 throughout; no dependency beyond the standard library.

mod error;
pub mod fit;
pub mod kernel;
pub mod nonuniform;
pub mod recurrent;

pub use error::SamplingError;
pub use fit::{Fit, FitSample};
pub use kernel::{BSpline, sinc, sinc_slope};
pub use recurrent::Recurrent;
