//! Hybrid multirate filter banks with fractional delays.
//!
//! Several slow converters see the same analog signal through different front ends and with
//! different delays; hybank designs the digital synthesis filters that fuse them into one fast
//! signal with the least worst-case error, proves how good they are, and runs them.

pub mod sampling;

#[cfg(feature = "runtime")]
pub mod bank;
#[cfg(feature = "runtime")]
pub mod io;
#[cfg(feature = "runtime")]
pub mod runtime;
#[cfg(feature = "runtime")]
pub mod spec;

#[cfg(feature = "design")]
pub mod analog;
#[cfg(feature = "design")]
pub mod design;
#[cfg(feature = "design")]
pub mod linalg;
#[cfg(feature = "design")]
pub mod lmi;
#[cfg(feature = "design")]
pub mod lti;
#[cfg(feature = "design")]
pub mod simulate;

#[cfg(feature = "plot")]
pub mod plot;

#[cfg(feature = "cli")]
pub mod cli;
