//! The two number types that kernels run in.

use super::simd::{FirKernel, Isa};

/// f32 or f64.
pub(crate) trait Sample: Copy + Default + Send + Sync + std::fmt::Debug + 'static {
    /// Rounds to the nearest.
    fn from_f64(value: f64) -> Self;
    /// Exact.
    fn to_f64(self) -> f64;
    /// Neither NaN nor infinite.
    fn finite(self) -> bool;
    /// The FIR kernels for this type.
    fn fir_kernel(isa: Isa) -> FirKernel<Self>;
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
}
