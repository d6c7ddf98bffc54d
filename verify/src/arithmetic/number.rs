//! The trait of the floating-point numbers with which enclosures are computed.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// A floating-point number whose operations have a proven relative error.
pub trait Float:
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
