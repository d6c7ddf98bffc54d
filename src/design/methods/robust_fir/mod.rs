//! FIR design for delays, gains and cut-offs that are known up to a box of errors only.
//!
//! The taps minimise the largest norm over scenarios: points of the box, each with a plant of its own. A
//! scenario is nothing but more frequencies, so the exchange of [`crate::design::exchange`] solves it: it
//! adds pairs of a frequency and a scenario where the error peaks, not whole grids per scenario, and its
//! dual stays a lower bound for all banks of that length over the box. Scenario s is put at the frequencies
//! 2 pi s + omega. All responses in whole lags are the same there, so the exchange needs to know nothing of
//! scenarios.
//!
//! Taps that follow the delays (`affine`) are the same problem with more unknowns.

mod affine;
mod fixed;
mod grid_filters;
mod norms;
mod scenario_grid;
mod scenarios;
mod sheets;
#[cfg(test)]
mod tests;

pub use affine::TrackingStudy;
pub(crate) use affine::{AffineDesign, synthesise as synthesise_affine};
pub use fixed::RobustStudy;
pub(crate) use fixed::synthesise;
pub use norms::RobustNorms;
pub(crate) use scenarios::RobustProblem;
