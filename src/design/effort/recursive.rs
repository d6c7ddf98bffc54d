//! The effort of recursive designs.

use super::amount::Effort;
use super::cost::{REAL, SMALL, SURVEYED, causal_bound, peak, proof, response, smoother};
use super::sizes::Sizes;

/// Riccati equations of an H-infinity design of many states, where the noncausal bound is nearly always
/// reached at once, and the operations of one relative to the cube of the states.
const TRIALS: f64 = 1.5;
const RICCATI: f64 = 150.0;
/// Frames of history on which the errors of all causal banks are computed, beyond the latency.
const HISTORY: f64 = 128.0;

/// The bank of least gamma. Not counted are the trials in extended precision where the optimum lies above
/// every bound: up to half a minute for up to 96 states, nothing beyond.
pub(super) fn design(sizes: &Sizes) -> Effort {
    riccati(sizes).times(TRIALS).then(norm(sizes).times(TRIALS)).then(noncausal(sizes))
}

/// The bank of least mean square.
pub(super) fn mean_square(sizes: &Sizes) -> Effort {
    riccati(sizes).then(norm(sizes)).then(noncausal(sizes))
}

fn riccati(sizes: &Sizes) -> Effort {
    let n = sizes.states + sizes.channels;
    Effort { seconds: SMALL * RICCATI * n.powi(3), bytes: 20.0 * REAL * n * n }
}

/// The error system has the states of the plant and those of the bank.
fn norm(sizes: &Sizes) -> Effort {
    let states = 2.0 * sizes.states;
    peak(states, response(&Sizes { front_end_states: states, ..*sizes }))
}

fn noncausal(sizes: &Sizes) -> Effort {
    peak(sizes.front_end_states, response(sizes))
}

/// The search for a proof of the norm and of the lower bound.
pub(super) fn proven(sizes: &Sizes) -> Effort {
    proof(2.0 * sizes.states).then(causal_bound(sizes))
}

/// Order reduction: a norm for each order that is visited, and the refinement of poles.
pub(super) fn reduction(sizes: &Sizes) -> Effort {
    let visits = sizes.states.min(40.0);
    norm(sizes).times(2.0 * visits)
}

/// The errors of all causal banks at all latencies, by the smoother.
pub(super) fn causal_errors(sizes: &Sizes) -> Effort {
    let frames = 2.0 * HISTORY + (sizes.longest_delay / sizes.ratio).ceil();
    smoother(sizes, frames, SURVEYED)
}
