//! Analog front ends: from a written filter to checked state equations in normalised time.
//!
//! Time is measured in fast periods h from here on: t' = t/h, s' = s h, so that a bank for nanoseconds
//! and one for seconds are the same numbers. Poles, zeros and coefficients are scaled *first* and
//! realised afterwards.
//!
//! - [`StrictlyProper`] is the type that the designer works with: stable, strictly proper, real.
//! - [`families`] are the classical low-passes as [`Zpk`].
//!
//! # How a filter is realised
//! Zeros and poles become a cascade of first- and second-order sections, each pole pair with the
//! zeros nearest to it and the most resonant pair last; never a companion matrix, whose roots drown in
//! rounding from order six on. Numerators and denominators are factored first. Multiple poles come out
//! of that wrong by the m-th root of rounding, but together they rebuild the coefficients, and so does
//! the cascade the response; this is checked, and a polynomial that its roots do not rebuild to 1e-13 in
//! every coefficient is realised in controllable canonical form with frequency measured by its natural
//! frequency. In the end every state is scaled, by a power of two, to unit energy when an impulse
//! arrives: then no state is large only because its pole is fast.

mod balance;
mod error;
pub mod families;
mod pairing;
mod rational;
mod realise;
mod roots;
mod section;
mod strictly_proper;
mod zpk;

pub use error::AnalogError;
pub use strictly_proper::StrictlyProper;
pub use zpk::Zpk;

/// Least -Re(p)/|p| of a pole: a quality factor of 5e8. Eigenvalues of a realisation are not known
/// better than this, so a pole closer to the axis cannot be told from an unstable one.
pub const MIN_DAMPING_RATIO: f64 = 1e-9;

/// Least modulus of a pole in rad a fast period. A slower one decays over 1e9 samples; e^p rounds to
/// seven digits of its distance from 1 there, and nothing that is sampled tells it from an integrator.
pub const MIN_NORMALISED_POLE: f64 = 1e-9;

/// Largest modulus of a pole in rad a fast period. A faster one has settled within 1e-9 of a sample.
pub const MAX_NORMALISED_POLE: f64 = 1e9;

#[cfg(test)]
mod tests;
