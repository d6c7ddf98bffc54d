//! Samples at known instants that need not repeat: recorders and sensors with clocks of their own, time
//! stamps, lost samples.
//!
//! A signal f of power 1 and spectrum S passes the front ends `Phi_i`. Sample k is
//! `x_k = g_i y_i(t_k) + n_k`, with its converter i, its true instant `t_k` and white noise `n_k` of
//! variance `v_i`. Wanted is `y_0(t)`, the output of the target. With
//!
//! ```text
//! C_kl = int S Phi_i conj(Phi_j) e^{2 pi j f (t_k - t_l)} df + v_i [k = l]
//! r_k  = int S Phi_i conj(Phi_0) e^{2 pi j f (t_k - t)} df
//! ```
//!
//! (real parts; i and j are the converters of samples k and l) the taps `g = C^-1 r` have the least
//! mean-square error `P_0 - r' g`, `P_0 = int S |Phi_0|^2 df`. Any other taps g have the error
//! `P_0 - 2 g' r + g' C g`, so the error of every output can be predicted (Wiener 1949; Kailath, Sayed and
//! Hassibi, Linear Estimation, chapter 3).
//!
//! [`Spectrum`] is S and [`Signals`] what the converters make of it. An [`Estimator`] gives taps and errors
//! for a set of samples, [`fuse`] the target from whole [`Recording`]s. Times are in fast periods, which
//! are those of the output.

#![forbid(unsafe_code)]

mod around;
mod clock;
mod covariance;
mod demand;
mod estimator;
mod fusion;
mod heldout;
mod knots;
mod learned;
mod live;
mod model;
mod noise;
mod recording;
mod signals;
mod spectrum;
mod ways;
pub use clock::{Clock, ClockError};
pub use estimator::{Estimator, EstimatorTaps, MeanSquare, SampleSet, TimedSample};
pub use fusion::{Fused, FusionSettings, fuse};
pub use heldout::{HeldOut, Trials};
pub use learned::learned;
pub use live::LiveFusion;
pub use model::{Model, PASSES, Prior, Response};
pub use recording::Recording;
pub use signals::{Converter, Signals};
pub use spectrum::{Node, Spectrum};
pub use ways::Ways;

#[cfg(test)]
mod tests;
