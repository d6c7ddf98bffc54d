//! Double-double arithmetic, accurate enough to evaluate a Bessel polynomial near its zeros.
//!
//! A value is the unevaluated sum of two doubles. Sources: Dekker, "A floating-point technique for extending
//! the available precision", Numerische Mathematik 18 (1971); the product by fused multiply-add.

use std::ops::{Add, Mul, Neg, Sub};

use crate::linalg::Complex;

/// About 32 decimal digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DoubleDouble {
    high: f64,
    low: f64,
}

/// A complex number with [`DoubleDouble`] parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ComplexDoubleDouble {
    re: DoubleDouble,
    im: DoubleDouble,
}

/// a + b and its rounding error, exactly.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

impl DoubleDouble {
    fn normalised(high: f64, low: f64) -> Self {
        let sum = high + low;
        Self { high: sum, low: low - (sum - high) }
    }
}

impl From<f64> for DoubleDouble {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        // Both error terms are kept: the variant with one loses all digits when the high parts cancel.
        let (high, error) = two_sum(self.high, other.high);
        let (low, low_error) = two_sum(self.low, other.low);
        let first = Self::normalised(high, error + low);
        Self::normalised(first.high, first.low + low_error)
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
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
        let product = self.high * other.high;
        let error = self.high.mul_add(other.high, -product);
        Self::normalised(product, error + (self.high * other.low + self.low * other.high))
    }
}

impl ComplexDoubleDouble {
    /// Multiplied by a real double.
    pub(super) fn scaled(self, factor: f64) -> Self {
        Self { re: self.re * factor.into(), im: self.im * factor.into() }
    }

    /// Rounded to double precision.
    pub(super) fn rounded(self) -> Complex<f64> {
        Complex::new(self.re.high, self.im.high)
    }
}

impl From<Complex<f64>> for ComplexDoubleDouble {
    fn from(z: Complex<f64>) -> Self {
        Self { re: z.re.into(), im: z.im.into() }
    }
}

impl Add for ComplexDoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Mul for ComplexDoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}
