//! Chebyshev filters: equal ripple in the pass band (1) or in the stop band (2).

use super::{excess_power, left_half, product_of_negatives};
use crate::analog::{Cutoffs, Zpk};
use crate::linalg::Complex;

/// Chebyshev 1: poles on an ellipse. The gain ripples by `ripple_db` (> 0 dB) below the cutoff and falls
/// above it.
pub fn chebyshev1(order: usize, ripple_db: f64) -> Zpk<Cutoffs> {
    let ripple = excess_power(ripple_db);
    let poles = ellipse(order, (1.0 / ripple.sqrt()).asinh() / order as f64);
    let dc = if order.is_multiple_of(2) { 1.0 / (1.0 + ripple).sqrt() } else { 1.0 };
    let gain = dc * product_of_negatives(&poles);
    Zpk::new(Vec::new(), poles, gain)
}

/// Chebyshev 2 (inverse Chebyshev): the attenuation is at least `attenuation_db` (> 0 dB) from the cutoff
/// on. An even order has as many zeros as poles.
pub fn chebyshev2(order: usize, attenuation_db: f64) -> Zpk<Cutoffs> {
    let poles: Vec<Complex<f64>> = ellipse(order, excess_power(attenuation_db).sqrt().asinh() / order as f64)
        .iter()
        .map(|p| p.inv())
        .collect();
    // The zeros are the inverse Chebyshev nodes; the middle one of an odd order is at infinity.
    let zeros: Vec<Complex<f64>> = left_half(order, |angle| Complex::new(0.0, angle.sin()))
        .into_iter()
        .filter(|z| z.im != 0.0)
        .map(|z| Complex::new(0.0, 1.0 / z.im))
        .collect();
    let gain = product_of_negatives(&poles) / product_of_negatives(&zeros);
    Zpk::new(zeros, poles, gain)
}

/// Butterworth angles on the ellipse with half axes sinh(mu), cosh(mu).
fn ellipse(order: usize, mu: f64) -> Vec<Complex<f64>> {
    let (real, imaginary) = (mu.sinh(), mu.cosh());
    left_half(order, |angle| Complex::new(-real * angle.cos(), imaginary * angle.sin()))
}
