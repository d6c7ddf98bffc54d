//! Numbers of 106 bits: an unevaluated sum of two doubles, with a proven error for each operation.
//!
//! The algorithms are those of M. Joldes, J.-M. Muller, V. Popescu, *Tight and rigorous error bounds for
//! basic building blocks of double-word arithmetic*, ACM TOMS 44 (2017): AccurateDWPlusDW (error 3 u^2) and
//! DWTimesDW3 (5 u^2) with u = 2^-53; a quotient with the remainder by fused multiply-adds (19 u^2) and the
//! root with one Newton step (5 u^2). All of them are below [`ROUNDING`] = 64 u^2 relative; results that
//! underflow are off by less than 2^-1070. With x = xh + xl, |xl| <= u |xh|:
//!
//! - *Quotient x / y.* t = xh / yh, rounded. The product y t is formed with fused multiply-adds as rh + rl
//!   with an error of at most 2 u^2 |xh|. |x - y t| <= 3.1 u |xh|, so xh - rh is exact, the rounding of xl -
//!   rl is below 2.1 u^2 |xh|, and that of their sum below 5.2 u^2 |xh|. The rest divided by yh in place of
//!   y and rounded adds (3.2 + 5.3) u^2 |x / y|. In sum the quotient is right to 19 u^2.
//! - *Root.* r = sqrt(xh), rounded; xh - r^2 is exact by a fused multiply-add. Adding xl and dividing by 2 r
//!   rounds twice, 1.6 u^2 each, and 2 r stands for r + sqrt(x): 1.3 u^2. In sum 5 u^2.

use super::number::Float;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// 2^-100: bounds the relative error of every operation on [`DoubleDouble`], with room to spare.
const ROUNDING: f64 = 1.0 / (1u128 << 100) as f64;

/// Quotients of dividends below this, and roots of radicands below this, are formed of operands times
/// [`LIFT`]: their residuals would underflow, and with them the lower half of the result.
const LEAST_UNLIFTED: f64 = f64::from_bits((1023 - 700) << 52);
/// 2^300: lifts the smallest double above [`LEAST_UNLIFTED`] in two steps.
const LIFT: f64 = f64::from_bits((1023 + 300) << 52);

/// `high + low` with `|low| <= ulp(high) / 2`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DoubleDouble {
    high: f64,
    low: f64,
}

/// a + b exactly, as a rounded sum and its error (Knuth).
#[inline]
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let part = high - a;
    DoubleDouble { high, low: (a - (high - part)) + (b - part) }
}

/// [`two_sum`] for `|a| >= |b|` (Dekker).
#[inline]
fn fast_two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble { high, low: b - (high - a) }
}

/// a b exactly, as a rounded product and its error.
#[inline]
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    DoubleDouble { high, low: a.mul_add(b, -high) }
}

impl DoubleDouble {
    /// Times a power of two.
    #[inline]
    fn times(self, power: f64) -> Self {
        Self { high: self.high * power, low: self.low * power }
    }
}

impl Float for DoubleDouble {
    const ZERO: Self = Self { high: 0.0, low: 0.0 };
    const ROUNDING: f64 = ROUNDING;
    /// 0.5^30 / 30! = 4e-42.
    const SERIES_TERMS: usize = 30;

    #[inline]
    fn nearest(self) -> f64 {
        self.high
    }

    fn sqrt(self) -> Self {
        if self == Self::ZERO {
            return self;
        }
        if self.high.abs() < LEAST_UNLIFTED {
            return self.times(LIFT).sqrt().times(1.0 / LIFT.sqrt());
        }
        let root = self.high.sqrt();
        let rest = self.low + (-root).mul_add(root, self.high);
        fast_two_sum(root, rest / (2.0 * root))
    }
}

impl From<f64> for DoubleDouble {
    #[inline]
    fn from(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        let (s, t) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let v = fast_two_sum(s.high, s.low + t.high);
        fast_two_sum(v.high, t.low + v.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let c = two_product(self.high, other.high);
        let low = self.high.mul_add(other.low, self.low * other.low);
        fast_two_sum(c.high, c.low + self.low.mul_add(other.high, low))
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        if self.high.abs() < LEAST_UNLIFTED && self.high != 0.0 {
            return (self.times(LIFT) / other).times(1.0 / LIFT);
        }
        let first = self.high / other.high;
        let back = {
            let c = two_product(other.high, first);
            fast_two_sum(c.high, other.low.mul_add(first, c.low))
        };
        let rest = (self.high - back.high) + (self.low - back.low);
        fast_two_sum(first, rest / other.high)
    }
}

#[cfg(test)]
mod tests {
    use super::super::exact::Exact;
    use super::*;
    use proptest::prelude::*;

    impl From<DoubleDouble> for Exact {
        fn from(x: DoubleDouble) -> Self {
            Self::from(x.high).plus(&x.low.into())
        }
    }

    /// Lower halves that are zero, half an ulp, or anything between, and exponents from `least` to `most`.
    fn any_number(least: i32, most: i32) -> impl Strategy<Value = DoubleDouble> {
        let low = prop_oneof![Just(0.0), Just(1.0), Just(-1.0), -1.0..1.0f64, -1e-9..1e-9f64];
        (1.0..2.0f64, low, least..most, any::<bool>()).prop_map(|(high, low, power, negative)| {
            let sum = fast_two_sum(high, low * 2f64.powi(-53));
            let scaled = sum.times(2f64.powi(power / 2)).times(2f64.powi(power - power / 2));
            if negative { -scaled } else { scaled }
        })
    }

    /// The bound of the trait: relative, or absolute times `scale` where a result underflows.
    fn is_proven(error: &Exact, size: &Exact, scale: &Exact) -> bool {
        let relative = size.abs().times(&ROUNDING.into());
        error.is_within(&relative.plus(&scale.abs().times(&Exact::power_of_two(-1070))))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4096, failure_persistence: None, ..ProptestConfig::default() })]

        /// Against exact integers, down to where doubles end.
        #[test]
        fn errors_are_those_that_are_proven(x in any_number(-1074, 500), y in any_number(-1074, 500), near in any_number(-3, 4)) {
            let ([a, b, c], one) = ([x, y, near].map(Exact::from), Exact::from(1.0));
            let close = x * near;
            for (u, v) in [(x, y), (x, close), (x, -close), (x, near)] {
                let sum = Exact::from(u).plus(&v.into());
                prop_assert!(is_proven(&Exact::from(u + v).minus(&sum), &sum, &one));
            }
            for (v, w) in [(y, &b), (near, &c)] {
                let product = a.times(w);
                prop_assert!(is_proven(&Exact::from(x * v).minus(&product), &product, &one));
                if v.high != 0.0 && (x / v).high.is_finite() {
                    let back = Exact::from(x / v).times(w);
                    prop_assert!(is_proven(&back.minus(&a), &a, w));
                }
            }
            let root = Exact::from(if x.high < 0.0 { -x } else { x }.sqrt());
            prop_assert!(root.times(&root).minus(&a.abs()).is_within(&a.times(&(2.0 * ROUNDING).into())));
        }
    }

    #[test]
    fn a_third_has_a_hundred_bits() {
        let third = DoubleDouble::from(1.0) / DoubleDouble::from(3.0);
        let rest = third * DoubleDouble::from(3.0) - DoubleDouble::from(1.0);
        assert!(rest.high.abs() <= ROUNDING);
        // The low part of 1/3 to double precision: 1/3 - fl(1/3) = 2^-54 / 3.
        assert!((third.low / (2f64.powi(-54) / 3.0) - 1.0).abs() < 1e-15);
    }

    /// The residual of a quotient or root below 1e-290 would underflow if nothing were scaled.
    #[test]
    fn small_numbers_keep_their_digits() {
        for power in [1e-295, 1e-300, 1e-307] {
            let third = DoubleDouble::from(power) / DoubleDouble::from(3.0 * 1e-20);
            let back = Exact::from(third).times(&(3.0 * 1e-20).into()).minus(&power.into());
            assert!(back.is_within(&Exact::from(power).times(&ROUNDING.into())));
            let root = Exact::from(DoubleDouble::from(power).sqrt());
            let rest = root.times(&root).minus(&power.into());
            assert!(rest.is_within(&Exact::from(power).times(&(2.0 * ROUNDING).into())));
        }
    }
}
