//! Points of the unit circle with their angles enclosed. A point is rational (see [`unit`]),
//! so its angle is not exactly the double that was asked for.

use super::super::ball::Ball;
use super::super::spectrum::unit;
use crate::arithmetic::{ComplexBall, DoubleDouble};

/// Terms of the series of sine and cosine: 2^60 / 60! = 1e-64.
const TERMS: usize = 30;

/// A frequency in radians per slow period.
#[derive(Debug, Clone)]
pub(super) struct Frequency {
    /// e^{j omega}.
    pub(super) z: ComplexBall<DoubleDouble>,
    /// omega.
    pub(super) angle: Ball,
}

impl Frequency {
    /// A rational point within 1e-15 or so of `omega`, which lies in [0, pi].
    pub(super) fn near(omega: f64) -> Self {
        let (s, c) = (0.5 * omega).sin_cos();
        let (sin, cos) = series(0.5 * omega);
        // (c, s) = r (cos, sin) of the true half angle: s cos - c sin = r sin(true half angle - omega / 2).
        let cross = Ball::from(s) * cos - Ball::from(c) * sin;
        let radius = (Ball::from(c) * Ball::from(c) + Ball::<DoubleDouble>::from(s) * Ball::from(s)).sqrt();
        let off = (cross / radius).magnitude();
        // asin x <= 1.01 x for small x; written so that NaN is refused too.
        let off = if off < 0.1 { 2.02 * off } else { f64::INFINITY };
        Self { z: unit([c, s]), angle: Ball::from(omega).widened(off) }
    }
}

/// sin x and cos x for x in [0, 2]: the terms alternate and fall, so the rest is at most the first one left
/// out.
fn series(x: f64) -> (Ball, Ball) {
    let (x, mut term) = (Ball::from(x), Ball::from(1.0));
    let (mut sin, mut cos) = (Ball::ZERO, Ball::ZERO);
    for k in 0..TERMS {
        let sign = Ball::from(if k % 2 == 0 { 1.0 } else { -1.0 });
        cos += sign * term;
        term = term * x / Ball::from((2 * k + 1) as f64);
        sin += sign * term;
        term = term * x / Ball::from((2 * k + 2) as f64);
    }
    let rest = term.magnitude();
    (sin.widened(rest), cos.widened(rest))
}

/// pi.
pub(super) fn pi() -> Ball {
    // The first two doubles of its expansion; the third one is 3e-33.
    let high = DoubleDouble::from(std::f64::consts::PI);
    Ball::exactly(high + DoubleDouble::from(1.224_646_799_147_353_2e-16)).widened(1e-31)
}

/// A lower bound of cos x for 0 <= x.
pub(super) fn cosine_below(x: f64) -> f64 {
    (1.0 - 0.5 * x * x * (1.0 + 1e-14)) * (1.0 - f64::EPSILON)
}

/// A bound for a sum of nonnegative doubles that was rounded a few thousand times.
pub(super) fn outward(x: f64) -> f64 {
    x * (1.0 + 1e-11) + f64::MIN_POSITIVE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_enclosed_and_tight() {
        for k in 0..=64 {
            let omega = std::f64::consts::PI * f64::from(k) / 64.0;
            let at = Frequency::near(omega);
            assert!(at.angle.radius() < 1e-15, "{omega}: {:?}", at.angle);
            assert!((at.z.re.nearest() - omega.cos()).abs() < 1e-15);
        }
    }

    #[test]
    fn sine_of_pi_is_zero() {
        let (sin, cos) = series(0.5 * std::f64::consts::PI);
        assert!((cos.nearest() - 0.5 * 1.224_646_799_147_353_2e-16).abs() < 1e-31);
        assert!((sin.nearest() - 1.0).abs() < 1e-16);
        assert!(pi().lower() <= std::f64::consts::PI && pi().upper() > std::f64::consts::PI);
    }
}
