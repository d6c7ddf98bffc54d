#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

pub use hybank_core::{bank, files, io, messages, npy, pipeline, quantity, spec, units};

/// The crate `hybank-runtime`: it compiles a bank into a plan, filters streams with it, and converts PCM
/// samples.
pub use hybank_runtime as runtime;

pub use hybank_design::{design, figures, lmi, lti};
pub use hybank_verify::{analog, verify};

/// The crate `hybank-instants`: signals from samples at known instants.
pub use hybank_instants as instants;

/// The crate `hybank-linalg`: matrix decompositions and Fourier transforms.
pub use hybank_linalg as linalg;

/// The crate `hybank-sampling`: splines, and samples that are not uniform.
pub use hybank_sampling as sampling;

pub mod align;
pub mod calibrate;
pub mod captures;
pub mod interchange;
pub mod measure;
pub mod merge;
pub mod overview;
pub mod plot;
pub mod simulate;
pub mod sine_fit;

#[cfg(test)]
use trials::random;
