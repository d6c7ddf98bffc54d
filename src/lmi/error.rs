//! Why data do not form a problem.

use crate::linalg::LinalgError;

/// Why data do not form a problem, or why it could not be solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LmiError {
    /// There is no point, or a dimension is zero.
    #[error(
        "a sampled problem needs points and M, N and q of at least 1, got {points} points, M = {m}, N = {n}, q = {q}"
    )]
    Empty {
        /// Number of points.
        points: usize,
        /// Rows of W.
        m: usize,
        /// Rows of H.
        n: usize,
        /// Columns of both.
        q: usize,
    },
    /// A matrix has the wrong size.
    #[error("{name} is {}x{} but must be {}x{} to fit the other matrices", given.0, given.1, wanted.0, wanted.1)]
    Size {
        /// Which matrix.
        name: String,
        /// Rows and columns given.
        given: (usize, usize),
        /// Rows and columns expected.
        wanted: (usize, usize),
    },
    /// A list has the wrong length.
    #[error("{given} {name} were given where {wanted} are needed")]
    Count {
        /// What was counted.
        name: &'static str,
        /// How many were given.
        given: usize,
        /// How many there must be.
        wanted: usize,
    },
    /// NaN or infinity.
    #[error("{name} holds a value that is not finite: check the system or response that it comes from")]
    NotFinite {
        /// Which datum.
        name: String,
    },
    /// A weight or the power of a noise is negative or not finite, or all weights are zero.
    #[error("{name} {index} is {value}: these are finite, not negative and not all zero")]
    Weight {
        /// What is weighted.
        name: &'static str,
        /// Its number, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// A tap beyond a row's own number of lags is not zero.
    #[error("row {row} of the taps is not zero at lag {lag}, beyond its {lags} lags")]
    TapBeyondLags {
        /// The row, from 0.
        row: usize,
        /// The lag of the tap.
        lag: usize,
        /// Lags of the row.
        lags: usize,
    },
    /// The cap lies below the start's own worst-case norm.
    #[error(
        "the cap {cap} is not above the start's worst-case norm {gamma}: start from taps that satisfy it strictly or raise the cap"
    )]
    Cap {
        /// The cap given.
        cap: f64,
        /// Worst-case norm of the taps given.
        gamma: f64,
    },
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}
