//! What formulas need that are computed in doubles and in balls.

use super::{Ball, Float};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Numbers with the four operations.
pub trait Field:
    Copy + Neg<Output = Self> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
}

impl<T> Field for T where
    T: Copy + Neg<Output = T> + Add<Output = T> + Sub<Output = T> + Mul<Output = T> + Div<Output = T>
{
}

/// What the entries of a matrix are: numbers, or balls.
pub trait MatrixEntry: Field + nalgebra::Scalar + Default + From<f64> {}

impl<T: Field + nalgebra::Scalar + Default + From<f64>> MatrixEntry for T {}

/// A real number, exact to rounding (`f64`) or enclosed ([`Ball`]). A formula that is generic over it is
/// written once for the design and for the proof.
pub trait Real: Field + From<f64> + PartialEq + std::fmt::Debug + 'static {
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

impl<F: Float> Real for Ball<F> {
    fn to_double(self) -> f64 {
        self.nearest()
    }
}
