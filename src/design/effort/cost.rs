//! Costs that several methods share.

use super::amount::Effort;
use super::sizes::Sizes;
use crate::design::prove::{MAX_LONG_STATES, MAX_SEARCHED_STATES, SEARCHED_PERIODS};
use crate::verify::MAX_RECURSION_STATES;

/// Bytes of a real and of a complex number.
pub(super) const REAL: f64 = 8.0;
pub(super) const COMPLEX: f64 = 16.0;

/// Seconds per operation in factorisations and products of large real matrices.
pub(super) const PRODUCT: f64 = 6e-11;
/// Seconds per operation in loops over small matrices, and over the columns of a triangular solution.
pub(super) const SMALL: f64 = 4e-10;
const SOLUTION: f64 = 1.2e-10;
/// Seconds per n^3 of the decompositions of complex n x n matrices, at n = `BLOCK`. Larger matrices are
/// decomposed at a higher rate, by this power of the size below and above.
const COMPLEX_CUBE: f64 = 4.4e-9;
const BLOCK: f64 = 66.0;
const GROWTH: f64 = 0.9;
const LARGE_GROWTH: f64 = 0.6;
/// Seconds per n^3 of the search for certificates of a system with n states, with their proof.
const CERTIFICATE: f64 = 9e-8;
/// The same for a certificate in 512 bits.
const LONG_CERTIFICATE: f64 = 1.3e-5;
/// Seconds per n^2 and per row, a sample or a front end's state, of a period of the causal recursion in 512
/// bits.
const RECURSION: f64 = 1e-7;
/// Samples of the target whose errors may still fall, at an instant of a survey of all latencies.
pub(super) const SURVEYED: f64 = 64.0;
/// Fast periods of latency beyond the longest delay with which the noncausal bound explains nearly any
/// optimum.
const NONCAUSAL_LATENCY: f64 = 32.0;

/// All eigenvalues of a real matrix of this order.
pub(super) fn eigenvalues(order: f64) -> Effort {
    Effort { seconds: 10.0 * PRODUCT * order.powi(3), bytes: 5.0 * REAL * order * order }
}

/// Factorisations and products of one complex matrix of this order in an interior-point iteration, or the
/// largest singular value of such a matrix.
pub(super) fn complex_cube(order: f64) -> f64 {
    let growth = if order > BLOCK { LARGE_GROWTH } else { GROWTH };
    COMPLEX_CUBE * order.powi(3) * (BLOCK / order.max(1.0)).powf(growth)
}

/// The response of the plant at one frequency, compressed to a triangular factor. Delays by whole periods
/// are factors of it.
pub(super) fn response(sizes: &Sizes) -> Effort {
    let (n, p) = (sizes.front_end_states, sizes.outputs());
    let w = n + p;
    let seconds = SOLUTION * (8.0 * n * n * (1.0 + p) + 4.0 * p * n * w) + 0.2 * complex_cube(p);
    Effort { seconds, bytes: COMPLEX * (n * n + p * w) }
}

/// The peak gain of a system: eigenvalues of a matrix twice as large for two levels, and the gains on a grid
/// with two frequencies per state, each of which takes `gain`.
pub(super) fn peak(states: f64, gain: Effort) -> Effort {
    let grid = gain.times(2.0 * states.max(16.0));
    grid.then(eigenvalues(2.0 * states).times(2.0))
}

/// The search for a proof of the norm of an error system with so many states. It is counted as if 512 bits
/// were needed where they are tried.
pub(super) fn proof(states: f64) -> Effort {
    if states > MAX_SEARCHED_STATES as f64 {
        return Effort::default();
    }
    let long = if states > MAX_LONG_STATES as f64 { 0.0 } else { LONG_CERTIFICATE };
    Effort { seconds: (CERTIFICATE + long) * states.powi(3), bytes: 30.0 * REAL * states * states }
}

/// The fixed-point smoother over so many frames, with so many samples of the target at a time.
pub(super) fn smoother(sizes: &Sizes, frames: f64, targets: f64) -> Effort {
    let s = sizes.front_end_states;
    let steps = frames * sizes.outputs();
    Effort { seconds: SMALL * steps * 8.0 * s * s * (s + targets), bytes: COMPLEX * (s * s + steps * s) }
}

/// Whether the noncausal bound explains the optimum, so that no other bound is searched.
pub(super) fn is_noncausal(sizes: &Sizes) -> bool {
    sizes.latency - sizes.longest_delay > NONCAUSAL_LATENCY
}

/// The search for the causal bound.
pub(super) fn causal_bound(sizes: &Sizes) -> Effort {
    if sizes.states > MAX_RECURSION_STATES as f64 || is_noncausal(sizes) {
        return Effort::default();
    }
    let rows = sizes.outputs() + sizes.front_end_states;
    let seconds = RECURSION * SEARCHED_PERIODS as f64 * sizes.states.powi(2) * rows;
    Effort { seconds, bytes: 0.0 }
}
