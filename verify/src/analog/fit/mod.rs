//! Models of measured front ends: responses of network analysers and Bode plots, and the stable, strictly
//! proper filters that are fitted to them.
//!
//! - [`MeasuredResponse`] is a response on a list of frequencies, read from Touchstone or CSV text.
//! - [`vector_fit`] gives a [`FittedModel`] with the error that it leaves.
//! - [`Measurements`] does both for the files that a spec names.
//!
//! ```
//! use hybank_verify::analog::fit::{MeasuredResponse, vector_fit};
//! use hybank_core::spec::FilterSpec;
//! // 1 / (1 + j f / 1 kHz), an RC low-pass.
//! let mut sweep = String::from("frequency (kHz),gain (dB),phase (deg)\n");
//! for f in [0.25_f64, 0.5, 1.0, 2.0, 4.0] {
//!     sweep += &format!("{f},{},{}\n", -10.0 * (1.0 + f * f).log10(), -f.atan().to_degrees());
//! }
//! let model = vector_fit(&MeasuredResponse::from_csv(&sweep)?, 1)?;
//! assert!(model.error.0 < 1e-9);
//! let FilterSpec::StateSpace { a, .. } = model.filter else { unreachable!("state equations") };
//! assert!((a[0][0] / (-2.0 * std::f64::consts::PI * 1e3) - 1.0).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
