//! Interval arithmetic with midpoint and radius. The midpoint has 106 bits (or 512), and every operation
//! adds a bound of its rounding error to the radius. A result encloses the exact result for all values in
//! the operands.
//!
//! Radii are doubles. That of x y, for example, is |x| r_y + |y| r_x + r_x r_y, and each result is
//! multiplied by [`OUTWARD`], which is more than the dozen roundings in it can take away. A midpoint below
//! all doubles counts as 1e-290 in a radius; a divisor that reaches out of the normal doubles, and a radius
//! that overflows, make the result unknown, and what is unknown proves nothing.

use super::{DoubleDouble, Float, Float512};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Compensates for the rounding of the radius itself: at most a dozen operations in double precision.
pub const OUTWARD: f64 = 1.0 + 32.0 * f64::EPSILON;
/// Covers what underflows: the operations err by less than 2^-1070 there, and `nearest` by 2^-1074.
const UNDERFLOW_ERROR: f64 = 1e-290;

/// All numbers x with `|x - mid| <= radius`. With an infinite or NaN radius the number is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ball<F = DoubleDouble> {
    mid: F,
    radius: f64,
}

/// A ball of 512 bits.
pub type LongBall = Ball<Float512>;

impl<F: Float> Ball<F> {
    /// Zero, exactly.
    pub const ZERO: Self = Self { mid: F::ZERO, radius: 0.0 };

    /// Its centre.
    #[inline]
    pub fn mid(self) -> F {
        self.mid
    }

    /// The nearest double to the midpoint.
    #[inline]
    pub fn nearest(self) -> f64 {
        self.mid.nearest()
    }

    /// The radius.
    #[inline]
    pub fn radius(self) -> f64 {
        self.radius
    }

    /// Exactly the midpoint given.
    #[inline]
    pub fn exactly(mid: F) -> Self {
        Self { mid, radius: 0.0 }
    }

    /// The same midpoint, `by` further in both directions.
    #[inline]
    pub fn widened(self, by: f64) -> Self {
        Self { mid: self.mid, radius: (self.radius + by) * OUTWARD }
    }

    /// A bound on the modulus.
    #[inline]
    pub fn magnitude(self) -> f64 {
        (self.size() + self.radius) * OUTWARD
    }

    /// A bound on the modulus of the midpoint, up to a relative error of 2^-52.
    #[inline]
    fn size(self) -> f64 {
        if self.mid == F::ZERO { 0.0 } else { self.mid.nearest().abs() + UNDERFLOW_ERROR }
    }

    /// No value of the ball is less.
    #[inline]
    pub fn lower(self) -> f64 {
        // 2^-52 is the error of the nearest double, the rest that of the difference.
        self.mid.nearest() - (self.radius + self.size() * (2.0 * f64::EPSILON)) * OUTWARD
    }

    /// No value of the ball is larger.
    #[inline]
    pub fn upper(self) -> f64 {
        -(-self).lower()
    }

    /// Whether this is exactly zero.
    #[inline]
    pub fn is_zero(self) -> bool {
        self == Self::ZERO
    }

    #[inline]
    fn rounded(mid: F, inherited: f64) -> Self {
        Self { mid, radius: (inherited + F::ROUNDING * mid.nearest().abs()) * OUTWARD + UNDERFLOW_ERROR }
    }

    /// A number of which nothing is known.
    #[inline]
    pub fn unknown() -> Self {
        Self { mid: F::from(f64::NAN), radius: f64::NAN }
    }

    /// Enclosure of the root; NaN if the ball contains negative numbers, or positive ones that are not
    /// clearly above the least double.
    pub fn sqrt(self) -> Self {
        let least = self.lower();
        if least.is_nan() || least < 0.0 {
            return Self::unknown();
        }
        let root = self.mid.sqrt();
        // |sqrt(x) - sqrt(m)| = |x - m| / (sqrt(x) + sqrt(m)).
        let spread = if self.radius == 0.0 { 0.0 } else { self.radius / root.nearest() };
        Self::rounded(root, spread)
    }
}

impl LongBall {
    /// The enclosed numbers in the precision of `F`.
    pub fn shortened<F: Float>(self) -> Ball<F> {
        if self.radius.is_nan() {
            return Ball::unknown();
        }
        let (mut mid, mut rest, mut pieces) = (F::ZERO, self.mid, 0.0);
        let negligible = F::ROUNDING * self.mid.nearest().abs();
        while rest.nearest().abs() > negligible {
            mid += F::from(rest.nearest());
            rest = rest - Float512::from(rest.nearest());
            pieces += 1.0;
        }
        // Each sum is rounded, and what is left is negligible.
        if self.is_zero() { Ball::ZERO } else { Ball::rounded(mid, self.radius + pieces * negligible) }
    }
}

impl<F: Float> From<f64> for Ball<F> {
    #[inline]
    fn from(value: f64) -> Self {
        Self { mid: value.into(), radius: 0.0 }
    }
}

impl<F: Float> Neg for Ball<F> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { mid: -self.mid, radius: self.radius }
    }
}

impl<F: Float> Add for Ball<F> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        match (self.is_zero(), other.is_zero()) {
            (true, _) => other,
            (_, true) => self,
            _ => Self::rounded(self.mid + other.mid, self.radius + other.radius),
        }
    }
}

impl<F: Float> Sub for Ball<F> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<F: Float> Mul for Ball<F> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return Self::ZERO;
        }
        let spread = self.size() * other.radius + other.size() * self.radius + self.radius * other.radius;
        Self::rounded(self.mid * other.mid, spread)
    }
}

impl<F: Float> Div for Ball<F> {
    type Output = Self;
    /// NaN if the divisor's ball contains zero or reaches out of the normal doubles.
    #[inline]
    fn div(self, other: Self) -> Self {
        let least = other.mid.nearest().abs() * (1.0 - f64::EPSILON) - other.radius * OUTWARD;
        if !least.is_normal() || least < 0.0 {
            return Self::unknown();
        }
        if self.is_zero() {
            return Self::ZERO;
        }
        let quotient = Self::exactly(self.mid / other.mid);
        // |x/y - m/n| <= |x - m| / |y| + |m/n| |y - n| / |y|, where the last factor may underflow.
        let relative = if other.radius == 0.0 { 0.0 } else { other.radius / least + f64::MIN_POSITIVE };
        let spread = self.radius / least + quotient.size() * relative;
        Self::rounded(quotient.mid, spread * OUTWARD)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Float512, exact::Exact};
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

    /// Balls with midpoints and radii from the least to the largest doubles and beyond.
    fn any_ball<F: Float>(most: i32) -> impl Strategy<Value = Ball<F>> {
        let power = move || prop_oneof![-10..10, -most..most, -1074..-900, 900..1020];
        let radius = prop_oneof![Just(0.0), Just(1e-300), Just(1e300), 1.0..2.0f64];
        (-2.0..2.0f64, power(), power(), radius, power()).prop_map(|(x, p, q, radius, r)| {
            let mid = F::from(x) * F::from(2f64.powi(p)) * F::from(2f64.powi(q.clamp(-500, 500)));
            Ball::exactly(mid).widened(radius * 2f64.powi(r.min(1000)))
        })
    }

    /// Values of a ball: its ends, its middle and another.
    fn values<F: Float + Into<Exact>>(ball: Ball<F>) -> [Exact; 4] {
        [-1.0, 0.0, 0.75, 1.0].map(|t| ball.mid.into().plus(&Exact::from(ball.radius).times(&t.into())))
    }

    fn is_unknown<F: Float>(ball: Ball<F>) -> bool {
        !ball.radius.is_finite()
    }

    /// Whether `ball` holds `numerator` / `denominator`.
    fn holds<F: Float + Into<Exact>>(ball: Ball<F>, numerator: &Exact, denominator: &Exact) -> bool {
        is_unknown(ball) || {
            let rest = ball.mid.into().times(denominator).minus(numerator);
            rest.is_within(&Exact::from(ball.radius).times(denominator))
        }
    }

    fn holds_root<F: Float + Into<Exact>>(ball: Ball<F>, square: &Exact) -> bool {
        let [least, .., most] = if is_unknown(ball) { return true } else { values(ball) };
        let zero = Exact::from(0.0);
        let is_low = least.times(&least).is_within(square) || least.plus(&least.abs()).is_within(&zero);
        is_low && square.is_within(&most.times(&most))
    }

    fn all_values_are_held<F: Float + Into<Exact>>(x: Ball<F>, y: Ball<F>) -> Result<(), TestCaseError> {
        let one = Exact::from(1.0);
        for u in values(x) {
            prop_assert!(!x.magnitude().is_finite() || u.is_within(&x.magnitude().into()));
            for bound in [x.lower(), x.upper()].into_iter().filter(|bound| bound.is_finite()) {
                let above =
                    if bound == x.lower() { u.minus(&bound.into()) } else { Exact::from(bound).minus(&u) };
                prop_assert!(above.minus(&above.abs()).is_within(&Exact::from(0.0)), "{:?} {bound:e}", x);
            }
            if !is_unknown(x.sqrt()) {
                prop_assert!(holds_root(x.sqrt(), &u), "root of {:?}", x);
            }
            for v in values(y) {
                prop_assert!(holds(x + y, &u.plus(&v), &one), "{:?} + {:?}", x, y);
                prop_assert!(holds(x * y, &u.times(&v), &one), "{:?} times {:?}", x, y);
                prop_assert!(holds(x / y, &u, &v), "{:?} over {:?}", x, y);
            }
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4096, failure_persistence: None, ..ProptestConfig::default() })]

        /// Against exact integers.
        #[test]
        fn no_value_is_lost_however_large_or_small(
            x in any_ball::<Float512>(1020), y in any_ball::<Float512>(1020),
            u in any_ball::<DoubleDouble>(400), v in any_ball::<DoubleDouble>(400),
        ) {
            if !is_unknown(x) && !is_unknown(y) {
                all_values_are_held(x, y)?;
            }
            if [u, v].iter().all(|&ball| !is_unknown(ball) && ball.nearest().is_finite()) {
                all_values_are_held(u, v)?;
            }
        }
    }

    /// Numbers that no double holds: the product of a tiny midpoint with a wide ball, and a quotient by
    /// a huge number.
    #[test]
    fn midpoints_beyond_the_doubles_count() {
        let tiny = Float512::from(1e-200) * Float512::from(1e-130);
        let wide = Ball::<Float512>::ZERO.widened(1e100);
        assert!((Ball::exactly(tiny) * wide).radius() >= 1e-230);
        let quotient = Ball::<Float512>::ZERO.widened(1e308) / Ball::exactly(Float512::from(1.0) / tiny);
        assert!(quotient.radius().is_nan() || quotient.radius() >= 1e-22);
        assert!(Ball::exactly(-tiny).lower() < 0.0 && Ball::exactly(tiny).magnitude() > 0.0);
    }

    #[test]
    fn what_is_unknown_stays_unknown() {
        let zero = Ball::<DoubleDouble>::from(1e-9).widened(1e-8);
        let unknown = Ball::from(1.0) / zero;
        assert!(unknown.radius().is_nan() && (unknown + Ball::from(1.0)).radius().is_nan());
        assert!(Ball::<DoubleDouble>::from(-1.0).sqrt().radius().is_nan());
    }
}
