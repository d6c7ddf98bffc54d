//! The two number types that kernels run in.

use crate::simd::Element;

/// f32 or f64: what kernels compute in, and what samples in memory are. No other type can be one.
#[allow(private_bounds, reason = "the private bound closes the trait")]
pub trait Sample: Element + PartialOrd {
    /// States of recursions below this become zero, before they are denormal and slow: 1e-30 (f32), 1e-280
    /// (f64).
    const NEGLIGIBLE: Self;
    /// Rounds to the nearest.
    fn from_f64(value: f64) -> Self;
    /// Exact.
    fn to_f64(self) -> f64;
    /// Neither NaN nor infinite.
    fn finite(self) -> bool;
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
