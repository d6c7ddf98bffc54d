//! Discrete-time state-space systems: connections, responses, Gramians, peak gains, Riccati equations.
//!
//! This module does not depend on filter banks: a system has inputs, outputs and states. Continuous-time
//! helpers (`exponential`) serve exact discretisation.

pub(crate) mod exponential;
mod fir_matrix;
mod fir_with_tail;
pub(crate) mod gramian;
mod interconnect;
pub(crate) mod parallel_form;
pub(crate) mod peak;
mod refine;
mod response;
pub(crate) mod riccati;
mod state_space;

pub use fir_matrix::FirMatrix;
pub(crate) use fir_with_tail::FirWithTail;
pub(crate) use gramian::GramianCoordinates;
pub use refine::Peak;
pub use response::FrequencyResponse;
pub(crate) use riccati::bounded_real_riccati;
pub use state_space::StateSpace;

use hybank_linalg::LinalgError;

/// Why a property of a system could not be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
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
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}
