#![doc = include_str!("../README.md")]
//!
//! * `kernel`: centred B-splines of odd degree, with slopes;
//! * [`fit`]: regularised, weighted least squares in a shift-invariant spline space, solved in O(M n^2);
//! * [`fit2`]: the same for images, with tensor products;
//! * [`Recurrent`]: perfect reconstruction from M interleaved sample sets (Yen's formula);
//! * [`nonuniform`]: samples with value errors and jitter;
//! * [`SmoothingSpline`]: smoothing splines through such samples, with what is known between them.
//!
//! Unit spacing and f64 throughout, f32 in `fit2`.
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

pub mod fit;
pub mod fit2;
mod kernel;
mod learned;
pub mod nonuniform;
mod recurrent;
mod smoothing;

pub use fit::{Fit, FitSample};
pub use fit2::Fit2;
pub use learned::{Known, LearnedCourse, LearnedSpline, few_readings, median, usual_deviation};
pub use recurrent::Recurrent;
pub use smoothing::{LeftOut, SmoothingSpline};

/// Faults of sample sets, offsets and settings handed to the sampling core.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SamplingError {
    /// Two recurrent sets sample the same instants.
    #[error(
        "sample sets {first} and {second} are {distance:e} fast periods apart modulo the period; two sets must not coincide, so change one of the delays"
    )]
    Coinciding {
        /// Index of one set.
        first: usize,
        /// Index of the other set.
        second: usize,
        /// Distance modulo the period, in fast periods.
        distance: f64,
    },
    /// A number that has to be finite is not.
    #[error("{name} {index} is {value}: every {name} must be a finite number")]
    NotFinite {
        /// What the number is.
        name: &'static str,
        /// Its index in the argument.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A setting lies outside its range.
    #[error("{name} is {value}: it must be {rule}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Value given.
        value: f64,
        /// The range in words.
        rule: &'static str,
    },
    /// The normal equations lost positive definiteness.
    #[error(
        "the normal equations are not positive definite at coefficient {column} (pivot {pivot:e}): no sample determines it; give the first differences a positive weight tau"
    )]
    NotDefinite {
        /// Column of the failing pivot.
        column: usize,
        /// The pivot.
        pivot: f64,
    },
}

#[cfg(test)]
use trials::random;
