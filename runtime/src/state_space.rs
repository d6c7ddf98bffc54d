//! Recursive filters as they are given.

/// A filter in state space, one step per frame: x+ = a x + b u, y = c x + d u; u the N samples of a frame, y
/// its M output samples. Row-major lists of rows.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// n x n.
    pub a: Vec<Vec<f64>>,
    /// n x N.
    pub b: Vec<Vec<f64>>,
    /// M x n.
    pub c: Vec<Vec<f64>>,
    /// M x N.
    pub d: Vec<Vec<f64>>,
}
