//! Vectors of one sample type, alike for all instruction sets.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// A register of samples.
///
/// # Safety
/// The methods of a type may only run on a processor that has its instruction set, and inside a
/// function compiled for it (or else they are calls instead of instructions). `load` and `store`
/// touch `LANES` samples from `at`.
pub(super) trait Vector: Copy {
    type Sample: Copy + Default;
    const LANES: usize;
    unsafe fn splat(value: Self::Sample) -> Self;
    unsafe fn load(at: *const Self::Sample) -> Self;
    unsafe fn store(self, at: *mut Self::Sample);
    /// self * factor + sum, rounded once.
    unsafe fn mul_add(self, factor: Self, sum: Self) -> Self;
}

/// Arrays that the compiler turns into whatever vectors the architecture has.
#[derive(Clone, Copy)]
pub(super) struct Portable<T>(pub(super) [T; 4]);

/// True where `mul_add` is an instruction of every processor of the target.
pub(super) const FUSED: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

macro_rules! portable {
    ($sample:ty) => {
        impl Vector for Portable<$sample> {
            type Sample = $sample;
            const LANES: usize = 4;

            #[inline(always)]
            unsafe fn splat(value: $sample) -> Self {
                Self([value; 4])
            }

            #[inline(always)]
            unsafe fn load(at: *const $sample) -> Self {
                Self(unsafe { at.cast::<[$sample; 4]>().read_unaligned() })
            }

            #[inline(always)]
            unsafe fn store(self, at: *mut $sample) {
                unsafe { at.cast::<[$sample; 4]>().write_unaligned(self.0) }
            }

            #[inline(always)]
            unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
                Self(std::array::from_fn(|lane| {
                    let (a, b, c) = (self.0[lane], factor.0[lane], sum.0[lane]);
                    if FUSED { a.mul_add(b, c) } else { a * b + c }
                }))
            }
        }
    };
}

portable!(f32);
portable!(f64);

#[cfg(target_arch = "x86_64")]
macro_rules! x86 {
    ($name:ident, $register:ty, $sample:ty, $lanes:literal, $splat:ident, $load:ident, $store:ident, $fma:ident) => {
        #[derive(Clone, Copy)]
        pub(super) struct $name(pub(super) $register);

        impl Vector for $name {
            type Sample = $sample;
            const LANES: usize = $lanes;

            #[inline(always)]
            unsafe fn splat(value: $sample) -> Self {
                Self(unsafe { $splat(value) })
            }

            #[inline(always)]
            unsafe fn load(at: *const $sample) -> Self {
                Self(unsafe { $load(at) })
            }

            #[inline(always)]
            unsafe fn store(self, at: *mut $sample) {
                unsafe { $store(at, self.0) }
            }

            #[inline(always)]
            unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
                Self(unsafe { $fma(self.0, factor.0, sum.0) })
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
x86!(Avx2F32, __m256, f32, 8, _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_fmadd_ps);
#[cfg(target_arch = "x86_64")]
x86!(Avx2F64, __m256d, f64, 4, _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_fmadd_pd);
#[cfg(target_arch = "x86_64")]
x86!(Avx512F32, __m512, f32, 16, _mm512_set1_ps, _mm512_loadu_ps, _mm512_storeu_ps, _mm512_fmadd_ps);
