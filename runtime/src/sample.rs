//! The two number types that kernels run in, and how many samples a frame has.

use crate::simd::SimdElement;

/// The numbers of samples per frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// N, channels of the input.
    pub channels: usize,
    /// M, output samples.
    pub ratio: usize,
}

/// f32 or f64: what kernels compute in, and what samples in memory are. No other type can be one.
#[allow(private_bounds, reason = "the private bound closes the trait")]
pub trait Sample: SimdElement + PartialOrd {
    /// Rounds to the nearest.
    fn from_f64(value: f64) -> Self;
    /// Exact.
    fn to_f64(self) -> f64;
}

impl Sample for f32 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Sample for f64 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}

/// The samples themselves, if they are of type `T`.
pub(crate) fn same<S: Sample, T: Sample>(samples: &[S]) -> Option<&[T]> {
    // Of the two types no other has the size of this one.
    (size_of::<S>() == size_of::<T>()).then(|| bytemuck::cast_slice(samples))
}

/// The samples themselves, if they are of type `T`.
pub(crate) fn same_mut<S: Sample, T: Sample>(samples: &mut [S]) -> Option<&mut [T]> {
    (size_of::<S>() == size_of::<T>()).then(|| bytemuck::cast_slice_mut(samples))
}
