//! Interior-point methods for two linear matrix inequalities (LMIs).
//!
//! | module | problem | practical size |
//! |---|---|---|
//! | [`sampled`] | least worst-case norm of `W - F H` at sampled frequencies | 1000 taps, 500 frequencies |
//! | [`kyp`] | bounded real lemma with outputs affine in the unknowns | tens of states, at most 160 |
//!
//! The design methods use [`sampled`]. Its optimum on a finite set of frequencies is a lower bound for the
//! whole unit circle; with the peaks of the norm added as points, the two optima meet. [`kyp`] solves the
//! same problem with a Lyapunov matrix instead of frequencies (thesis 5.4) and serves as an independent
//! check.
//!
//! Both are primal-dual predictor-corrector methods with one loop and one step rule (`iteration`). A hard
//! problem is not an error: each solver returns its best iterate, bounds on the optimum and an [`Outcome`].
//! Rounding errors limit the relative accuracy of the optimum to about 1e-9 in [`sampled`] and 1e-8 in
//! [`kyp`].

mod error;
mod factor;
mod iteration;
pub mod kyp;
pub mod sampled;
#[cfg(test)]
#[path = "../../tests/support/testbank.rs"]
mod testbank;

pub use error::LmiError;
pub use iteration::{Outcome, Settings};
