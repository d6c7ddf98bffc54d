//! Analog front ends: from a written filter to checked state equations in normalised time.
//!
//! From this module on, time is normalised by the fast period h: t' = t/h, s' = s h. A bank for nanoseconds
//! and one for seconds therefore have the same numbers. Poles, zeros and coefficients are scaled *before*
//! they are realised.
//!
//! - [`StrictlyProper`] is the type that the designer works with: stable, strictly proper, real, normalised.
//! - [`StableFilter`] is the same with a direct term: the filter W of a signal.
//! - `families` are the classical low-passes, enclosed.
//! - [`fit`] makes filters of measured responses.
//!
//! # How a filter is realised
//! Zeros and poles become a cascade of first- and second-order sections. Each pole pair gets the zeros
//! nearest to it, and the most resonant pair comes last. A companion matrix would lose its roots to
//! rounding from order six on.
//!
//! Numerators and denominators are factored first, in 512 bits: multiple roots are found exactly, the others
//! enclosed by discs that hold one root each. The design takes the nearest doubles to the real and imaginary
//! parts of the roots. The proof takes the balls: `enclosed` realises a written filter with every rounding
//! error bounded, from the same formulas.
//!
//! Finally every state is scaled by a power of two so that its impulse response has unit energy up to
//! rounding to that power: no state is large only because its pole is fast.

mod cutoff;
mod error;
mod families;
pub mod fit;
mod half_power;
mod pairing;
mod polynomial;
mod realise;
mod roots;
mod section;
mod signal;
mod square_free;
mod strictly_proper;

pub use cutoff::CutoffRemainder;
pub use section::Realisation;
pub use signal::{SignalFilter, resolved_band, signal};
pub use strictly_proper::enclosed;

pub use error::AnalogError;
pub use strictly_proper::{StableFilter, StrictlyProper};

/// Least -Re(p)/|p| of a pole: a quality factor of 5e8. Eigenvalues of a realisation are not known to
/// higher accuracy, so a pole closer to the imaginary axis might as well be unstable.
pub const MIN_DAMPING_RATIO: f64 = 1e-9;

/// Least modulus of a pole, rad per fast period. A slower one decays over more than 1e9 samples: 1 - e^p
/// keeps only seven digits there, and samples do not distinguish the pole from an integrator.
pub const MIN_NORMALISED_POLE: f64 = 1e-9;

/// Largest modulus of a pole, rad per fast period. A faster one settles within 1e-9 fast periods.
pub const MAX_NORMALISED_POLE: f64 = 1e9;

/// Least and largest gain of a filter, the modulus of its response at 0 or at a pole's frequency.
/// Products of the gains of a target and two channels stay within double precision.
pub const MIN_GAIN: f64 = 1e-60;
/// See [`MIN_GAIN`].
pub const MAX_GAIN: f64 = 1e60;

#[cfg(test)]
mod tests;
