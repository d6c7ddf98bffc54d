//! What a design is doing, for a caller who waits for it.

use std::fmt;

/// A step of a design that may take long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The latency is chosen; so many designs were compared.
    Latency {
        /// Designs so far.
        designs: usize,
    },
    /// The method computes the filters.
    Filters,
    /// Order reduction, integer taps, and the form that runs fastest.
    Realisation,
    /// The search for a proof.
    Proof,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Latency { designs: 0 } => write!(f, "choosing the latency"),
            Self::Latency { designs } => write!(f, "choosing the latency ({designs} designs compared)"),
            Self::Filters => write!(f, "designing the filters"),
            Self::Realisation => write!(f, "realising the filters"),
            Self::Proof => write!(f, "searching for a proof of gamma"),
        }
    }
}

/// Called with the step that begins and the estimated seconds of the whole design.
pub type Observer<'a> = &'a dyn Fn(Stage, f64);

/// An observer that looks away.
pub fn unobserved(_: Stage, _: f64) {}
