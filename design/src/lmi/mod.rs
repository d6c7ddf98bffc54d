//! The interior-point method for the least worst-case norm of `W - F H` at sampled frequencies
//! ([`sampled`]), for up to about 1000 taps and 500 frequencies.
//!
//! The optimum on a finite set of frequencies is a lower bound for the whole unit circle; with the peaks of
//! the norm added as points, the two optima meet. They are those of the linear matrix inequality of thesis
//! 5.4, whose Lyapunov matrix the frequencies replace.
//!
//! The worst case and the mean square under a cap are primal-dual predictor-corrector methods with one loop
//! and one step rule (`iteration`). A hard problem is not an error: the solver returns its best iterate
//! and bounds on the optimum. Rounding errors limit the relative accuracy of the optimum to about 1e-9.

mod factor;
mod iteration;
pub mod sampled;
mod settings;
#[cfg(test)]
#[path = "../../../tests/support/testbank.rs"]
mod testbank;

pub use iteration::{FINEST_GAP, IsDue};
