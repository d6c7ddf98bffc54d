//! Complex numbers of 106 bits, accurate enough to evaluate a Bessel polynomial near its zeros.

use std::ops::{Add, Mul};

use crate::arithmetic::{DoubleDouble, Number};
use crate::linalg::Complex;

/// A complex number with [`DoubleDouble`] parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ComplexDoubleDouble {
    re: DoubleDouble,
    im: DoubleDouble,
}

impl ComplexDoubleDouble {
    /// Multiplied by a real double.
    pub(super) fn scaled(self, factor: f64) -> Self {
        Self { re: self.re * factor.into(), im: self.im * factor.into() }
    }

    /// Rounded to double precision.
    pub(super) fn rounded(self) -> Complex<f64> {
        Complex::new(self.re.nearest(), self.im.nearest())
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
