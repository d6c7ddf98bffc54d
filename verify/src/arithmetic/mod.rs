//! Real numbers of more than 53 bits, with a proven relative error for each operation.
//!
//! [`DoubleDouble`] has 106 bits and [`Float512`] has 512. Both are a [`Float`], the trait over which
//! enclosures and the decompositions of [`dense`] are generic: [`Ball`] encloses a real number,
//! [`ComplexBall`] a complex one. A formula that is generic over [`Real`] is computed in doubles and in
//! balls.

mod ball;
mod big_float;
mod cartesian;
pub mod dense;
mod double_double;
pub mod elementary;
#[cfg(test)]
#[path = "tests/exact.rs"]
mod exact;
mod number;
mod real;

pub use ball::{Ball, LongBall, OUTWARD};
pub use big_float::{BigFloat, Float512};
pub use cartesian::{Cartesian, ComplexBall};
pub use double_double::DoubleDouble;
pub use number::Float;
pub use real::{MatrixEntry, Real};

use std::ops::{AddAssign, SubAssign};

/// The assignments by which matrices of these numbers are added.
macro_rules! assignments {
    ($([$($f:tt)*] $number:ty),*) => {$(
        impl<$($f)*> AddAssign for $number {
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }

        impl<$($f)*> SubAssign for $number {
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
    )*};
}

assignments!([] DoubleDouble, [const WORDS: usize] BigFloat<WORDS>, [F: Float] Ball<F>, [F: Float] ComplexBall<F>);
