//! Numbers of 106 bits: an unevaluated sum of two doubles, with a proven error for each operation.
//!
//! The algorithms are those of M. Joldes, J.-M. Muller, V. Popescu, *Tight and rigorous error bounds for
//! basic building blocks of double-word arithmetic*, ACM TOMS 44 (2017): AccurateDWPlusDW (error 3 u^2),
//! DWTimesDW3 (5 u^2), DWDivDW2 (15 u^2 + 56 u^3) with u = 2^-53, and the square root of V. Lefevre, N.
//! Louvet, J.-M. Muller, J. Picot, L. Rideau, *Accurate calculation of Euclidean norms using double-word
//! arithmetic*, ACM TOMS 49 (2023) (25/8 u^2). All of them are below [`ROUNDING`] relative, unless a result
//! underflows.

use super::number::Number;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// 2^-100: bounds the relative error of every operation on [`DoubleDouble`], with room to spare.
const ROUNDING: f64 = 1.0 / (1u128 << 100) as f64;

/// `high + low` with `|low| <= ulp(high) / 2`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct DoubleDouble {
    high: f64,
    low: f64,
}

/// a + b exactly, as a rounded sum and its error (Knuth).
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let part = high - a;
    DoubleDouble { high, low: (a - (high - part)) + (b - part) }
}

/// [`two_sum`] for `|a| >= |b|` (Dekker).
fn fast_two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    DoubleDouble { high, low: b - (high - a) }
}

/// a b exactly, as a rounded product and its error.
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    DoubleDouble { high, low: a.mul_add(b, -high) }
}

impl Number for DoubleDouble {
    const ZERO: Self = Self { high: 0.0, low: 0.0 };
    const ROUNDING: f64 = ROUNDING;
    /// 0.5^30 / 30! = 4e-42.
    const SERIES_TERMS: usize = 30;

    fn nearest(self) -> f64 {
        self.high
    }

    fn sqrt(self) -> Self {
        if self == Self::ZERO {
            return self;
        }
        let root = self.high.sqrt();
        let rest = self.low + (-root).mul_add(root, self.high);
        fast_two_sum(root, rest / (2.0 * root))
    }
}

impl From<f64> for DoubleDouble {
    fn from(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (s, t) = (two_sum(self.high, other.high), two_sum(self.low, other.low));
        let v = fast_two_sum(s.high, s.low + t.high);
        fast_two_sum(v.high, t.low + v.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let c = two_product(self.high, other.high);
        let low = self.high.mul_add(other.low, self.low * other.low);
        fast_two_sum(c.high, c.low + self.low.mul_add(other.high, low))
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
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
    use super::*;
    use proptest::prelude::*;

    /// m 2^e with integers, so that sums and products can be checked in exact integer arithmetic.
    fn double(m: i64, low: i64) -> DoubleDouble {
        // high: 50 bits; low: below half an ulp of high.
        fast_two_sum(m as f64, low as f64 * 2f64.powi(-60))
    }

    /// The value times 2^60, exactly.
    fn scaled(x: DoubleDouble) -> i128 {
        (x.high * 2f64.powi(60)) as i128 + (x.low * 2f64.powi(60)) as i128
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn sums_keep_their_error(a in -1i64 << 49..1 << 49, b in -1i64 << 49..1 << 49, la in -99i64..99, lb in -99i64..99) {
            let (x, y) = (double(a, la), double(b, lb));
            let exact = scaled(x) + scaled(y);
            prop_assert!(((scaled(x + y) - exact).abs() as f64) <= ROUNDING * (exact.abs() as f64));
        }

        #[test]
        fn products_quotients_and_roots_undo_each_other(a in 1i64..1 << 49, b in 1i64..1 << 49, la in -99i64..99, lb in -99i64..99) {
            let (x, y) = (double(a, la), double(b, lb));
            let back = (x * y) / y - x;
            prop_assert!(back.high.abs() <= 3.0 * ROUNDING * x.high);
            let root = x.sqrt();
            let back = root * root - x;
            prop_assert!(back.high.abs() <= 4.0 * ROUNDING * x.high);
        }

        #[test]
        fn products_are_those_of_integers(a in -1i64 << 55..1 << 55, b in -1i64 << 50..1 << 50) {
            let split = |v: i64| two_sum((v >> 26 << 26) as f64, (v & ((1 << 26) - 1)) as f64);
            let exact = i128::from(a) * i128::from(b);
            let product = split(a) * split(b);
            let error = (product.high as i128 - exact) + product.low as i128;
            prop_assert!((error.abs() as f64) <= ROUNDING * (exact.abs() as f64) + 1.0);
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
}
