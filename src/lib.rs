#![cfg_attr(feature = "design", doc = include_str!("../README.md"))]
#![cfg_attr(not(feature = "design"), doc = "Runs hybrid multirate filter banks with fractional delays.")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]

#[cfg(feature = "files")]
pub mod files;
pub mod messages;
#[cfg(feature = "files")]
pub mod npy;
#[cfg(feature = "program")]
pub mod program;
pub mod quantity;
pub mod sampling;
pub mod units;

#[cfg(feature = "runtime")]
pub mod bank;
#[cfg(feature = "runtime")]
pub mod interchange;
#[cfg(feature = "runtime")]
pub mod io;
#[cfg(feature = "runtime")]
pub mod pipeline;
#[cfg(feature = "runtime")]
pub mod spec;

/// The crate `hybank-runtime`: it compiles a bank into a plan, filters streams with it, and converts PCM
/// samples.
#[cfg(feature = "runtime")]
pub use hybank_runtime as runtime;

/// The crate `hybank-linalg`: matrix decompositions and Fourier transforms.
#[cfg(feature = "design")]
pub use hybank_linalg as linalg;

#[cfg(feature = "design")]
pub mod analog;
#[cfg(feature = "design")]
pub(crate) mod arithmetic;
#[cfg(feature = "design")]
pub mod calibrate;
#[cfg(feature = "design")]
pub mod captures;
#[cfg(feature = "design")]
pub mod design;
#[cfg(feature = "design")]
pub mod figures;
#[cfg(feature = "design")]
pub mod lmi;
#[cfg(feature = "design")]
pub mod lti;
#[cfg(feature = "design")]
pub mod measure;
#[cfg(feature = "design")]
pub mod simulate;
#[cfg(feature = "design")]
pub mod sine_fit;
#[cfg(feature = "design")]
pub mod track;
#[cfg(feature = "design")]
pub mod verify;

#[cfg(feature = "plot")]
pub mod plot;

#[cfg(all(feature = "design", feature = "plot"))]
pub mod overview;

#[cfg(test)]
#[path = "../tests/support/random.rs"]
mod random;

#[cfg(test)]
#[path = "../tests/support/trials.rs"]
#[allow(dead_code, unreachable_pub)]
mod trials;
