//! The two number types that kernels run in.

use super::simd::{self, FirKernel, Halves, Isa, Products, RecursionKernel, TransformKernel};

/// f32 or f64.
pub(crate) trait Sample:
    Copy + Default + PartialOrd + std::ops::Add<Output = Self> + Send + Sync + std::fmt::Debug + 'static
{
    /// Below this a state is as good as zero; above it all arithmetic is fast.
    const NEGLIGIBLE: Self;
    /// Rounds to the nearest.
    fn from_f64(value: f64) -> Self;
    /// Exact.
    fn to_f64(self) -> f64;
    /// Neither NaN nor infinite.
    fn finite(self) -> bool;
    /// The FIR kernels for this type.
    fn fir_kernel(isa: Isa) -> FirKernel<Self>;
    /// The kernel of recursions for this type.
    fn recursion_kernel(isa: Isa) -> RecursionKernel<Self>;
    /// The kernel of transforms for this type.
    fn transform_kernel(isa: Isa) -> TransformKernel<Self>;
    /// True if surely all are finite, see [`simd::all_finite`].
    fn all_finite(isa: Isa, samples: &[Self]) -> bool;
    /// Pairs of frames apart, see [`simd::split_f32`].
    fn split_pairs(isa: Isa, frames: &[Self], n: usize, to: Halves<'_, Self>);
    /// Products of pairs together, see [`simd::join_f32`].
    fn join_pairs(isa: Isa, from: Products<'_, Self>, m: usize, out: &mut [Self]);
    /// The samples themselves, if they are f32.
    fn as_f32(samples: &[Self]) -> Option<&[f32]>;
    /// The samples themselves, if they are f32.
    fn as_f32_mut(samples: &mut [Self]) -> Option<&mut [f32]>;
    /// The samples themselves, if they are of this type.
    fn same<S: Sample>(samples: &[S]) -> Option<&[Self]>;
    /// The samples themselves, if they are of this type.
    fn same_mut<S: Sample>(samples: &mut [S]) -> Option<&mut [Self]>;
    /// The samples themselves, if they are f64.
    fn as_f64(samples: &[Self]) -> Option<&[f64]>;
    /// The samples themselves, if they are f64.
    fn as_f64_mut(samples: &mut [Self]) -> Option<&mut [f64]>;
}

impl Sample for f32 {
    const NEGLIGIBLE: Self = 1e-30;

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    #[inline(always)]
    fn finite(self) -> bool {
        self.is_finite()
    }

    fn fir_kernel(isa: Isa) -> FirKernel<Self> {
        FirKernel::for_f32(isa)
    }

    fn recursion_kernel(isa: Isa) -> RecursionKernel<Self> {
        RecursionKernel::<f32>::new(isa)
    }

    fn transform_kernel(isa: Isa) -> TransformKernel<Self> {
        TransformKernel::for_f32(isa)
    }

    fn all_finite(isa: Isa, samples: &[Self]) -> bool {
        simd::all_finite_f32(isa, samples)
    }

    fn split_pairs(isa: Isa, frames: &[Self], n: usize, to: Halves<'_, Self>) {
        simd::split_f32(isa, frames, n, to);
    }

    fn join_pairs(isa: Isa, from: Products<'_, Self>, m: usize, out: &mut [Self]) {
        simd::join_f32(isa, from, m, out);
    }

    fn as_f32(samples: &[Self]) -> Option<&[f32]> {
        Some(samples)
    }

    fn as_f32_mut(samples: &mut [Self]) -> Option<&mut [f32]> {
        Some(samples)
    }

    fn same<S: Sample>(samples: &[S]) -> Option<&[Self]> {
        S::as_f32(samples)
    }

    fn same_mut<S: Sample>(samples: &mut [S]) -> Option<&mut [Self]> {
        S::as_f32_mut(samples)
    }

    fn as_f64(_: &[Self]) -> Option<&[f64]> {
        None
    }

    fn as_f64_mut(_: &mut [Self]) -> Option<&mut [f64]> {
        None
    }
}

impl Sample for f64 {
    const NEGLIGIBLE: Self = 1e-280;

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline(always)]
    fn finite(self) -> bool {
        self.is_finite()
    }

    fn fir_kernel(isa: Isa) -> FirKernel<Self> {
        FirKernel::for_f64(isa)
    }

    fn recursion_kernel(isa: Isa) -> RecursionKernel<Self> {
        RecursionKernel::<f64>::new(isa)
    }

    fn transform_kernel(isa: Isa) -> TransformKernel<Self> {
        TransformKernel::for_f64(isa)
    }

    fn all_finite(isa: Isa, samples: &[Self]) -> bool {
        simd::all_finite_f64(isa, samples)
    }

    fn split_pairs(isa: Isa, frames: &[Self], n: usize, to: Halves<'_, Self>) {
        simd::split_f64(isa, frames, n, to);
    }

    fn join_pairs(isa: Isa, from: Products<'_, Self>, m: usize, out: &mut [Self]) {
        simd::join_f64(isa, from, m, out);
    }

    fn as_f32(_: &[Self]) -> Option<&[f32]> {
        None
    }

    fn as_f32_mut(_: &mut [Self]) -> Option<&mut [f32]> {
        None
    }

    fn same<S: Sample>(samples: &[S]) -> Option<&[Self]> {
        S::as_f64(samples)
    }

    fn same_mut<S: Sample>(samples: &mut [S]) -> Option<&mut [Self]> {
        S::as_f64_mut(samples)
    }

    fn as_f64(samples: &[Self]) -> Option<&[f64]> {
        Some(samples)
    }

    fn as_f64_mut(samples: &mut [Self]) -> Option<&mut [f64]> {
        Some(samples)
    }
}
