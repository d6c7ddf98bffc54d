//! The trait of the floating-point numbers with which enclosures are computed.

use super::Ball;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A floating-point number whose operations have a proven relative error.
pub(crate) trait Number:
    Copy
    + std::fmt::Debug
    + Default
    + PartialEq
    + Send
    + Sync
    + 'static
    + From<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + AddAssign
    + SubAssign
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// Zero.
    const ZERO: Self;
    /// Bounds the relative error of each operation whose result is not below 2^-960; below that the absolute
    /// error is less than 2^-1070.
    const ROUNDING: f64;
    /// Terms of an exponential series after which the remainder lies below the rounding.
    const SERIES_TERMS: usize;

    /// The nearest double, up to a relative error of 2^-52 and, below the normal numbers, 2^-1074.
    fn nearest(self) -> f64;

    /// NaN for negative numbers.
    fn sqrt(self) -> Self;
}

/// Numbers with the four operations.
pub(crate) trait Field:
    Copy + Neg<Output = Self> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
}

impl<T> Field for T where
    T: Copy + Neg<Output = T> + Add<Output = T> + Sub<Output = T> + Mul<Output = T> + Div<Output = T>
{
}

/// What the entries of a matrix are: numbers, or balls.
pub(crate) trait Entry: Field + nalgebra::Scalar + Default + From<f64> {}

impl<T: Field + nalgebra::Scalar + Default + From<f64>> Entry for T {}

/// A real number, exact to rounding (`f64`) or enclosed ([`Ball`]). A formula that is generic over it is
/// written once for the design and for the proof.
pub(crate) trait Real: Field + From<f64> + PartialEq + std::fmt::Debug + 'static {
    /// The nearest double, by which formulas choose among forms that are equal in exact arithmetic.
    fn to_double(self) -> f64;

    /// `self` times `base`^`exponent`, one factor at a time, so that no intermediate value leaves the range
    /// of doubles unless the result does.
    fn times_power(self, base: Self, exponent: i64) -> Self {
        let step = |x: Self| if exponent >= 0 { x * base } else { x / base };
        (0..exponent.unsigned_abs()).fold(self, |x, _| step(x))
    }
}

impl Real for f64 {
    fn to_double(self) -> f64 {
        self
    }
}

impl<F: Number> Real for Ball<F> {
    fn to_double(self) -> f64 {
        self.nearest()
    }
}
