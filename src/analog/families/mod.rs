//! Classical low-pass families as zeros, poles and gain.
//!
//! Every function returns the prototype with its cutoff at |s| = 1. "Cutoff" means what scipy.signal means
//! by it (`buttap`, `cheb1ap`, `cheb2ap`, `ellipap`, `besselap` with `norm="phase"`);
//! [`Zpk::low_pass`](super::Zpk::low_pass) moves it. The DC gain also follows scipy: 1, except `-ripple_db`
//! for Chebyshev 1 and elliptic filters of even order.
//!
//! All are closed formulas or convergent series, evaluated to double precision.

mod bessel;
mod chebyshev;
mod complex;
mod elliptic;
mod jacobi;

pub use bessel::bessel;
pub use chebyshev::{chebyshev1, chebyshev2};
pub use elliptic::{Selectivity, elliptic};

use std::f64::consts::FRAC_PI_2;

use super::{Cutoffs, Zpk};
use crate::linalg::Complex;

/// Butterworth: poles evenly on the unit circle, -3.01 dB at the cutoff.
pub fn butterworth(order: usize) -> Zpk<Cutoffs> {
    Zpk::new(Vec::new(), left_half(order, |angle| Complex::new(-angle.cos(), angle.sin())), 1.0)
}

/// One pole, -3.01 dB at the cutoff.
pub fn rc() -> Zpk<Cutoffs> {
    butterworth(1)
}

/// `root` at the angles (2 i - n + 1)/n * 90 degrees, i = 0..n: those of the Butterworth poles, counted
/// from the negative real axis. Conjugate angles give exactly conjugate roots, and the middle angle of an
/// odd order is exactly zero.
fn left_half(order: usize, root: impl Fn(f64) -> Complex<f64>) -> Vec<Complex<f64>> {
    let angle = |i: usize| FRAC_PI_2 * (2.0 * i as f64 - order as f64 + 1.0) / order as f64;
    (0..order).map(|i| root(angle(i))).collect()
}

/// prod(-roots), real by conjugate symmetry.
fn product_of_negatives(roots: &[Complex<f64>]) -> f64 {
    roots.iter().fold(Complex::new(1.0, 0.0), |product, r| product * -r).re
}

/// 10^(db/10) - 1 without cancellation for small `db`.
fn excess_power(db: f64) -> f64 {
    (db * std::f64::consts::LN_10 / 10.0).exp_m1()
}

#[cfg(test)]
mod tests;
