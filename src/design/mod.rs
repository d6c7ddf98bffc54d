//! From a spec to a bank: exact equivalence, blocking, IIR, H2 and FIR design, certificates.

pub mod equivalence;
pub mod error_system;
mod filtering;
pub mod iir;
pub mod problem;

pub use problem::Problem;

use crate::analog::AnalogError;
use crate::linalg::LinalgError;
use crate::lti::{LtiError, StateSpaceError};

/// Why a bank could not be designed or judged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// A filter of the spec is no front end.
    #[error(transparent)]
    Analog(#[from] AnalogError),
    /// A property of a system could not be computed.
    #[error(transparent)]
    Lti(#[from] LtiError),
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
    /// Matrices that do not belong together.
    #[error(transparent)]
    Shapes(#[from] StateSpaceError),
    /// A bank's state-space matrices have rows of unequal lengths.
    #[error("the bank's state-space matrices do not fit: expected {rows} rows of {cols} numbers")]
    RaggedStateSpace {
        /// Expected rows.
        rows: usize,
        /// Expected columns.
        cols: usize,
    },
    /// No Riccati equation could be solved, not even at the easy end.
    #[error(
        "the Riccati equation could not be solved at gamma = {gamma}: the front ends are too stiff or the \
         channels too nearly equal for double precision; try method = \"fir\", or move nearly equal delays apart"
    )]
    RiccatiFailed {
        /// The largest gamma tried.
        gamma: f64,
    },
}
