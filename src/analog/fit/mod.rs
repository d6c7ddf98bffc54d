//! Models of measured front ends: responses of network analysers and Bode plots, and the stable, strictly
//! proper filters that are fitted to them.
//!
//! - [`MeasuredResponse`] is a response on a list of frequencies, read from Touchstone or CSV text.
//! - [`vector_fit`] gives a [`FittedModel`] with the error that it leaves.
//! - [`Measurements`] does both for the files that a spec names.

mod error;
mod files;
mod measured;
mod text;
mod touchstone;
mod vector_fit;

pub use error::{FitError, MeasurementError};
pub use files::Measurements;
pub use measured::MeasuredResponse;
pub use vector_fit::{FittedModel, MAX_FIT_ERROR, vector_fit};

#[cfg(test)]
mod tests;
