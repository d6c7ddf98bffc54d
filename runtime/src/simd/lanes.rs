//! Lane groups as the numbers of transforms.
//!
//! rustfft transforms numbers of any type by additions, subtractions and products. Here a number is a lane
//! group, each lane for itself: frames of several channels are transformed as they lie, and every lane has
//! the bits that it would have alone. Nothing is fused, so these are the same on every processor.

use super::dispatch::SimdElement;
use super::portable::Portable;
use super::vector::VectorNumber;
use crate::Sample;
use rustfft::FftNum;
use rustfft::num_complex::Complex;
use rustfft::num_traits::{FromPrimitive, Num, One, Signed, Zero};
use std::array;
use std::ops::{Add, Div, Mul, Neg, Rem, Sub};

/// One frequency, or one frame of each block, of several channels or phases.
pub(crate) type Row<T> = Complex<<T as SimdElement>::Portable>;

/// A lane group that is a number of rustfft.
pub(crate) trait Lanes<T>: FftNum {
    /// The group whose lane l is `lane(l)`.
    fn of(lane: impl Fn(usize) -> T) -> Self;
    fn lanes(&self) -> &[T];
    fn lanes_mut(&mut self) -> &mut [T];
}

impl<T: Sample, const L: usize> Lanes<T> for Portable<T, L> {
    #[inline(always)]
    fn of(lane: impl Fn(usize) -> T) -> Self {
        Self(array::from_fn(lane))
    }

    #[inline(always)]
    fn lanes(&self) -> &[T] {
        &self.0
    }

    #[inline(always)]
    fn lanes_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

macro_rules! operator {
    ($operator:ident, $function:ident) => {
        impl<T: VectorNumber, const L: usize> $operator for Portable<T, L> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(array::from_fn(|l| $operator::$function(self.0[l], other.0[l])))
            }
        }
    };
}

operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);
operator!(Rem, rem);

impl<T: VectorNumber, const L: usize> Neg for Portable<T, L> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(array::from_fn(|l| -self.0[l]))
    }
}

impl<T: Sample, const L: usize> Zero for Portable<T, L> {
    fn zero() -> Self {
        Self([T::default(); L])
    }

    fn is_zero(&self) -> bool {
        self.0 == [T::default(); L]
    }
}

impl<T: Sample, const L: usize> One for Portable<T, L> {
    fn one() -> Self {
        Self([T::from_f64(1.0); L])
    }
}

impl<T: Sample, const L: usize> Num for Portable<T, L> {
    type FromStrRadixErr = <f64 as Num>::FromStrRadixErr;

    fn from_str_radix(text: &str, radix: u32) -> Result<Self, Self::FromStrRadixErr> {
        f64::from_str_radix(text, radix).map(|value| Self([T::from_f64(value); L]))
    }
}

impl<T: Sample, const L: usize> FromPrimitive for Portable<T, L> {
    fn from_i64(value: i64) -> Option<Self> {
        Self::from_f64(value as f64)
    }

    fn from_u64(value: u64) -> Option<Self> {
        Self::from_f64(value as f64)
    }

    fn from_f64(value: f64) -> Option<Self> {
        Some(Self([T::from_f64(value); L]))
    }
}

impl<T: Sample, const L: usize> Signed for Portable<T, L> {
    fn abs(&self) -> Self {
        Self(self.0.map(|x| T::from_f64(x.to_f64().abs())))
    }

    fn abs_sub(&self, other: &Self) -> Self {
        Self(array::from_fn(|l| if self.0[l] > other.0[l] { self.0[l] - other.0[l] } else { T::default() }))
    }

    fn signum(&self) -> Self {
        Self(self.0.map(|x| T::from_f64(x.to_f64().signum())))
    }

    fn is_positive(&self) -> bool {
        self.0.iter().all(|x| *x > T::default())
    }

    fn is_negative(&self) -> bool {
        self.0.iter().all(|x| *x < T::default())
    }
}
