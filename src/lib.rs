#![cfg_attr(feature = "design", doc = include_str!("../README.md"))]
#![cfg_attr(not(feature = "design"), doc = "Runs hybrid multirate filter banks with fractional delays.")]
#![forbid(unsafe_code)]

#[cfg(feature = "files")]
pub mod files;
pub mod sampling;
pub mod units;

#[cfg(feature = "runtime")]
pub mod bank;
#[cfg(feature = "runtime")]
pub mod io;
#[cfg(feature = "runtime")]
pub mod pipeline;
#[cfg(feature = "runtime")]
pub mod spec;

/// The crate `hybank-runtime`: plans, streams and PCM.
#[cfg(feature = "runtime")]
pub use hybank_runtime as runtime;

/// The crate `hybank-linalg`: decompositions and Fourier transforms.
#[cfg(feature = "design")]
pub use hybank_linalg as linalg;

#[cfg(feature = "design")]
pub mod analog;
#[cfg(feature = "design")]
pub mod design;
#[cfg(feature = "design")]
pub mod lmi;
#[cfg(feature = "design")]
pub mod lti;
#[cfg(feature = "design")]
pub mod simulate;
#[cfg(feature = "design")]
pub mod verify;

#[cfg(feature = "plot")]
pub mod plot;

#[cfg(feature = "cli")]
pub mod cli;
