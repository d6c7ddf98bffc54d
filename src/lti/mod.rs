//! Discrete-time state-space systems: connections, responses, Gramians, peak gains, Riccati equations.
//!
//! This module does not depend on filter banks: a system has inputs, outputs and states. Continuous-time
//! helpers ([`exponential`]) serve exact discretisation.

pub mod exponential;
mod fir_with_tail;
pub mod gramian;
mod interconnect;
pub mod parallel_form;
pub mod peak;
mod refine;
mod response;
pub mod riccati;
mod state_space;

pub use fir_with_tail::FirWithTail;
pub use gramian::GramianCoordinates;
pub use response::FrequencyResponse;
pub use riccati::bounded_real_riccati;
pub use state_space::{StateSpace, StateSpaceError};

use crate::linalg::LinalgError;

/// Why a property of a system could not be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LtiError {
    /// The property exists for stable systems only.
    #[error("the system is not stable: spectral radius {radius} (must be below 1)")]
    Unstable {
        /// Largest modulus of the eigenvalues of `a`.
        radius: f64,
    },
    /// An iteration reached its limit.
    #[error("{what} did not settle within {limit} steps (last relative change {change:e})")]
    IterationLimit {
        /// What was iterated.
        what: &'static str,
        /// The bound.
        limit: usize,
        /// The last change.
        change: f64,
    },
    /// Matrices that do not form a system.
    #[error(transparent)]
    Shapes(#[from] StateSpaceError),
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}
