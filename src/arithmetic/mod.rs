//! Real numbers of more than 53 bits, with a proven relative error for each operation.
//!
//! [`DoubleDouble`] has 106 bits and [`BigFloat`] has 512. Both are a [`Number`], the trait over which
//! enclosures and [`Matrix`] are generic.

mod big_float;
mod double_double;
mod matrix;
mod number;

pub(crate) use big_float::BigFloat;
pub(crate) use double_double::DoubleDouble;
pub(crate) use matrix::Matrix;
pub(crate) use number::Number;
