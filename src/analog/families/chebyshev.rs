//! Chebyshev filters: equal ripple in the pass band (1) or in the stop band (2).

use super::{Long, dc_gain, excess_power, exp_asinh, on_ellipse, product_of_negatives, upper_roots};
use crate::analog::roots::{Factors, RootSet};
use crate::arithmetic::{Ball, ComplexBall, elementary};

/// Chebyshev 1: poles on an ellipse. The gain ripples by `ripple_db` (> 0 dB) below the cutoff and falls
/// above it.
pub(super) fn first(order: usize, ripple_db: f64) -> Factors<Long> {
    let ripple = excess_power(ripple_db);
    let stretch = elementary::root(exp_asinh(Ball::from(1.0) / ripple.sqrt()), order);
    let poles = upper_roots(order, |angle| on_ellipse(stretch, angle));
    let gain = dc_gain(order, ripple) * product_of_negatives(&poles);
    Factors { zeros: RootSet::default(), poles, gain }
}

/// Chebyshev 2 (inverse Chebyshev): the attenuation is at least `attenuation_db` (> 0 dB) from the cutoff
/// on. An even order has as many zeros as poles.
pub(super) fn second(order: usize, attenuation_db: f64) -> Factors<Long> {
    let stretch = elementary::root(exp_asinh(excess_power(attenuation_db).sqrt()), order);
    let poles = upper_roots(order, |angle| {
        let z = on_ellipse(stretch, angle);
        z.scaled(Ball::from(1.0) / z.norm_sqr())
    });
    // The zeros are the inverse Chebyshev nodes; the middle one of an odd order is at infinity.
    let mut zeros = upper_roots(order, |angle| ComplexBall::new(Ball::ZERO, Ball::from(1.0) / angle.im));
    zeros.real.clear();
    let gain = product_of_negatives(&poles) / product_of_negatives(&zeros);
    Factors { zeros, poles, gain }
}
