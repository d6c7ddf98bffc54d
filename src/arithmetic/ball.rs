//! Interval arithmetic with midpoint and radius. The midpoint has 106 bits (or 512), and every operation
//! adds a bound of its rounding error to the radius. A result encloses the exact result for all values in
//! the operands.

use super::{DoubleDouble, Number};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Compensates for the rounding of the radius itself: at most a dozen operations in double precision.
pub(crate) const OUTWARD: f64 = 1.0 + 32.0 * f64::EPSILON;
/// Covers results that underflow.
const TINY: f64 = 1e-290;

/// All numbers x with `|x - mid| <= radius`. With an infinite or NaN radius the number is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Ball<F = DoubleDouble> {
    mid: F,
    radius: f64,
}

impl<F: Number> Ball<F> {
    pub(crate) const ZERO: Self = Self { mid: F::ZERO, radius: 0.0 };

    pub(crate) fn mid(self) -> F {
        self.mid
    }

    /// The nearest double to the midpoint.
    pub(crate) fn nearest(self) -> f64 {
        self.mid.nearest()
    }

    /// The radius.
    pub(crate) fn radius(self) -> f64 {
        self.radius
    }

    /// Exactly the midpoint given.
    pub(crate) fn exactly(mid: F) -> Self {
        Self { mid, radius: 0.0 }
    }

    /// The same midpoint, `by` further in both directions.
    pub(crate) fn widened(self, by: f64) -> Self {
        Self { mid: self.mid, radius: (self.radius + by) * OUTWARD }
    }

    /// A bound on the modulus.
    pub(crate) fn magnitude(self) -> f64 {
        (self.mid.nearest().abs() + self.radius) * OUTWARD
    }

    /// No value of the ball is less.
    pub(crate) fn lower(self) -> f64 {
        let value = self.mid.nearest();
        value - (self.radius + value.abs() * f64::EPSILON) * OUTWARD
    }

    /// No value of the ball is larger.
    pub(crate) fn upper(self) -> f64 {
        -(-self).lower()
    }

    /// Whether this is exactly zero.
    pub(crate) fn is_zero(self) -> bool {
        self == Self::ZERO
    }

    fn rounded(mid: F, inherited: f64) -> Self {
        Self { mid, radius: (inherited + F::ROUNDING * mid.nearest().abs()) * OUTWARD + TINY }
    }

    /// Enclosure of the root; NaN if the ball contains negative numbers.
    pub(crate) fn sqrt(self) -> Self {
        let least = self.lower();
        if least.is_nan() || least < 0.0 {
            return Self { mid: F::from(f64::NAN), radius: f64::NAN };
        }
        let root = self.mid.sqrt();
        // |sqrt(x) - sqrt(m)| = |x - m| / (sqrt(x) + sqrt(m)).
        let spread = if self.radius == 0.0 { 0.0 } else { self.radius / root.nearest() };
        Self::rounded(root, spread)
    }
}

impl<F: Number> From<f64> for Ball<F> {
    fn from(value: f64) -> Self {
        Self { mid: value.into(), radius: 0.0 }
    }
}

impl<F: Number> Neg for Ball<F> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { mid: -self.mid, radius: self.radius }
    }
}

impl<F: Number> Add for Ball<F> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        match (self.is_zero(), other.is_zero()) {
            (true, _) => other,
            (_, true) => self,
            _ => Self::rounded(self.mid + other.mid, self.radius + other.radius),
        }
    }
}

impl<F: Number> Sub for Ball<F> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<F: Number> Mul for Ball<F> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return Self::ZERO;
        }
        let (x, y) = (self.mid.nearest().abs(), other.mid.nearest().abs());
        let spread = x * other.radius + y * self.radius + self.radius * other.radius;
        Self::rounded(self.mid * other.mid, spread)
    }
}

impl<F: Number> Div for Ball<F> {
    type Output = Self;
    /// NaN if the divisor's ball contains zero.
    fn div(self, other: Self) -> Self {
        let least = other.mid.nearest().abs() * (1.0 - f64::EPSILON) - other.radius * OUTWARD;
        if least.is_nan() || least <= 0.0 {
            return Self { mid: F::from(f64::NAN), radius: f64::NAN };
        }
        let quotient = self.mid / other.mid;
        // |x/y - m/n| <= (|x - m| + |m/n| |y - n|) / |y|.
        let spread = (self.radius + quotient.nearest().abs() * OUTWARD * other.radius) / least;
        Self::rounded(quotient, spread * OUTWARD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

        /// The result encloses the results for all values in the operands; tested at the end points,
        /// against 106-bit arithmetic.
        #[test]
        fn results_hold_all_values(a in -1e3..1e3f64, b in -1e3..1e3f64, ra in 0.0..1.0f64, rb in 0.0..1.0f64, s in -1.0..1.0f64, t in -1.0..1.0f64) {
            let (x, y) = (Ball::<DoubleDouble>::from(a).widened(ra), Ball::from(b).widened(rb));
            let (u, v) = (DoubleDouble::from(a) + DoubleDouble::from(s * ra), DoubleDouble::from(b) + DoubleDouble::from(t * rb));
            let holds = |ball: Ball, value: DoubleDouble| ball.radius.is_nan() || (value - ball.mid).nearest().abs() <= ball.radius;
            prop_assert!(holds(x + y, u + v) && holds(x - y, u - v) && holds(x * y, u * v));
            prop_assert!(holds(x / y, u / v));
            prop_assert!(holds(x.sqrt(), u.sqrt()));
            prop_assert!(x.lower() <= u.nearest() && u.nearest() <= x.upper());
        }
    }

    #[test]
    fn what_is_unknown_stays_unknown() {
        let zero = Ball::<DoubleDouble>::from(1e-9).widened(1e-8);
        let unknown = Ball::from(1.0) / zero;
        assert!(unknown.radius().is_nan() && (unknown + Ball::from(1.0)).radius().is_nan());
        assert!(Ball::<DoubleDouble>::from(-1.0).sqrt().radius().is_nan());
    }
}
