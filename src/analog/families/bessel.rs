//! Bessel filters: zeros of the reverse Bessel polynomials.
//!
//! theta_0 = 1, theta_1 = s + 1, theta_n = (2n - 1) theta_(n-1) + s^2 theta_(n-2): polynomials with integer
//! coefficients. Source: Grosswald, "Bessel polynomials" (1978).

use std::sync::OnceLock;

use super::Long;
use crate::analog::AnalogError;
use crate::analog::polynomial::isolated;
use crate::analog::roots::{Factors, RootSet};
use crate::arithmetic::{Ball, Float512, Number, elementary};
use crate::spec::MAX_ORDER;

/// Bessel with `norm="phase"`: the magnitude falls asymptotically as a Butterworth filter of the same order
/// and cutoff; the phase at the cutoff is half of its total change. DC gain and leading coefficient are 1.
///
/// # Errors
/// [`AnalogError::RootsNotIsolated`]. The tests cover all orders up to [`MAX_ORDER`].
pub(super) fn bessel(order: usize) -> Result<Factors<Long>, AnalogError> {
    // The roots of an order are always the same, and those of a high order take milliseconds.
    static POLES: [OnceLock<Option<RootSet<Long>>>; MAX_ORDER + 1] =
        [const { OnceLock::new() }; MAX_ORDER + 1];
    let poles = POLES.get(order).and_then(|poles| poles.get_or_init(|| scaled_roots(order)).clone());
    let poles = poles.ok_or(AnalogError::RootsNotIsolated { what: "family" })?;
    Ok(Factors { zeros: RootSet::default(), poles, gain: Ball::from(1.0) })
}

/// The zeros of theta_n in units of their geometric mean, theta_n(0)^(1/n).
fn scaled_roots(n: usize) -> Option<RootSet<Long>> {
    let coefficients = reverse_bessel(n);
    let mean = elementary::root(Ball::exactly(*coefficients.last()?), n);
    Some(isolated(&coefficients)?.scaled(Ball::from(1.0) / mean))
}

/// theta_n in descending powers. Its integers are exact: the largest for n = 32 have 150 bits.
fn reverse_bessel(n: usize) -> Vec<Float512> {
    let one = Float512::from(1.0);
    let (mut previous, mut current) = (vec![one], vec![one, one]);
    for k in 2..=n {
        let factor = Float512::from(2.0 * k as f64 - 1.0);
        let mut next: Vec<Float512> =
            std::iter::once(Float512::ZERO).chain(current.iter().map(|&x| factor * x)).collect();
        previous.iter().enumerate().for_each(|(i, &x)| next[i] += x);
        (previous, current) = (current, next);
    }
    current
}
