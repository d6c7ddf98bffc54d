//! The two number types that kernels run in.

use super::simd::{self, FirKernel, Isa, Progress, RecursionKernel};
use crate::io::PcmFormat;

/// f32 or f64.
pub(crate) trait Sample:
    Copy + Default + PartialOrd + Send + Sync + std::fmt::Debug + 'static
{
    /// Size in memory.
    const BYTES: usize = size_of::<Self>();
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
    /// Below this a state is as good as zero; above it all arithmetic is fast.
    const NEGLIGIBLE: Self;
    /// |x|.
    fn magnitude(self) -> Self;
    /// Fast conversion of numbers to rows of this type, see [`simd::deinterleave_f32`].
    fn deinterleave_numbers<S: Sample>(
        isa: Isa,
        samples: &[S],
        n: usize,
        frames: usize,
        rows: &mut [Self],
        stride: usize,
    ) -> Progress;
    /// Fast conversion of bytes to rows of this type, see [`simd::deinterleave`].
    fn deinterleave_bytes(
        isa: Isa,
        format: PcmFormat,
        bytes: &[u8],
        n: usize,
        frames: usize,
        rows: &mut [Self],
        stride: usize,
    ) -> Progress;
    /// Fast conversion of rows of this type to f32 frames, see [`simd::interleave`].
    fn interleave(isa: Isa, rows: &[Self], stride: usize, m: usize, frames: usize, out: &mut [f32]) -> usize;
    /// The samples themselves, if they are f32.
    fn as_f32(samples: &[Self]) -> Option<&[f32]>;
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

    const NEGLIGIBLE: Self = 1e-30;

    #[inline(always)]
    fn magnitude(self) -> Self {
        self.abs()
    }

    fn deinterleave_numbers<S: Sample>(
        isa: Isa,
        samples: &[S],
        n: usize,
        frames: usize,
        rows: &mut [Self],
        stride: usize,
    ) -> Progress {
        S::as_f32(samples)
            .map(|samples| simd::deinterleave_f32(isa, samples, n, frames, rows, stride))
            .unwrap_or_default()
    }

    fn deinterleave_bytes(
        isa: Isa,
        format: PcmFormat,
        bytes: &[u8],
        n: usize,
        frames: usize,
        rows: &mut [Self],
        stride: usize,
    ) -> Progress {
        simd::deinterleave(isa, format, bytes, n, frames, rows, stride)
    }

    fn interleave(isa: Isa, rows: &[Self], stride: usize, m: usize, frames: usize, out: &mut [f32]) -> usize {
        simd::interleave(isa, rows, stride, m, frames, out)
    }

    fn as_f32(samples: &[Self]) -> Option<&[f32]> {
        Some(samples)
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

    const NEGLIGIBLE: Self = 1e-280;

    #[inline(always)]
    fn magnitude(self) -> Self {
        self.abs()
    }

    fn deinterleave_numbers<S: Sample>(
        _: Isa,
        _: &[S],
        _: usize,
        _: usize,
        _: &mut [Self],
        _: usize,
    ) -> Progress {
        Progress::default()
    }

    fn deinterleave_bytes(
        _: Isa,
        _: PcmFormat,
        _: &[u8],
        _: usize,
        _: usize,
        _: &mut [Self],
        _: usize,
    ) -> Progress {
        Progress::default()
    }

    fn interleave(_: Isa, _: &[Self], _: usize, _: usize, _: usize, _: &mut [f32]) -> usize {
        0
    }

    fn as_f32(_: &[Self]) -> Option<&[f32]> {
        None
    }
}
