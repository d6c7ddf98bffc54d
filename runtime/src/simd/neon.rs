//! NEON: one lane group is two registers. Arithmetic has instructions of its own; what else the trait has
//! goes by its defaults, which the compiler knows how to vectorise, because every aarch64 processor has
//! NEON.

use super::vector::Vector;
use std::arch::aarch64::*;

/// Eight lanes of f32.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NeonF32([float32x4_t; 2]);

/// Four lanes of f64.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NeonF64([float64x2_t; 2]);

/// Both registers by one intrinsic.
macro_rules! both {
    ($intrinsic:ident, $($argument:expr),*) => {
        // SAFETY: a vector exists only where its instructions do.
        Self(unsafe { [$intrinsic($($argument.0[0]),*), $intrinsic($($argument.0[1]),*)] })
    };
}

macro_rules! neon {
    ($vector:ident, $sample:ty, $lanes:literal, $dup:ident $load:ident $store:ident $add:ident $fma:ident) => {
        impl Vector for $vector {
            type Sample = $sample;
            const LANES: usize = $lanes;
            // Of 32 registers: 12 sums of two, and room for inputs and coefficients.
            const SUMS: usize = 12;

            #[inline(always)]
            unsafe fn splat(value: $sample) -> Self {
                Self([$dup(value); 2])
            }

            #[inline(always)]
            unsafe fn load(at: *const $sample) -> Self {
                Self([$load(at), $load(at.add($lanes / 2))])
            }

            #[inline(always)]
            unsafe fn store(self, at: *mut $sample) {
                $store(at, self.0[0]);
                $store(at.add($lanes / 2), self.0[1]);
            }

            #[inline(always)]
            fn add(self, other: Self) -> Self {
                both!($add, self, other)
            }

            #[inline(always)]
            fn mul_add(self, factor: Self, sum: Self) -> Self {
                both!($fma, sum, self, factor)
            }
        }
    };
}

neon!(NeonF32, f32, 8, vdupq_n_f32 vld1q_f32 vst1q_f32 vaddq_f32 vfmaq_f32);
neon!(NeonF64, f64, 4, vdupq_n_f64 vld1q_f64 vst1q_f64 vaddq_f64 vfmaq_f64);
