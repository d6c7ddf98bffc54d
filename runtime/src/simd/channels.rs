//! Vectors whose lanes are channels or phases, each of which is transformed on its own.
//!
//! A *group* is 32 bytes: 8 lanes of f32, 4 of f64. It holds D lanes for each of group / D *segments*, spans of the
//! stream that are transformed side by side: 8 channels of one segment, or 2 channels of four.

#[cfg(target_arch = "x86_64")]
use super::vector::{Avx2F32, Avx2F64};
use super::vector::{FUSED, Portable, Vector};
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// What transforms need beside multiply-adds.
///
/// # Safety
/// As for [`Vector`]; memory is touched as said for each method.
pub(super) trait ChannelVector: Vector {
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    unsafe fn mul(self, factor: Self) -> Self;
    /// sum - self * factor, rounded once.
    unsafe fn mul_sub(self, factor: Self, sum: Self) -> Self;
    /// Lanes `part..part + LANES` of the group whose D lanes of segment s are those from `at + s * hop` on.
    unsafe fn gather<const D: usize>(at: *const Self::Sample, hop: usize, part: usize) -> Self;
    /// Lanes `part..part + LANES` of a group in which every lane of a segment is lane `n` of that segment in the
    /// group at `row`.
    unsafe fn spread<const D: usize>(row: *const Self::Sample, n: usize, part: usize) -> Self;
}

macro_rules! portable {
    ($sample:ty) => {
        impl ChannelVector for Portable<$sample> {
            #[inline(always)]
            unsafe fn add(self, other: Self) -> Self {
                Self(std::array::from_fn(|l| self.0[l] + other.0[l]))
            }

            #[inline(always)]
            unsafe fn sub(self, other: Self) -> Self {
                Self(std::array::from_fn(|l| self.0[l] - other.0[l]))
            }

            #[inline(always)]
            unsafe fn mul(self, factor: Self) -> Self {
                Self(std::array::from_fn(|l| self.0[l] * factor.0[l]))
            }

            #[inline(always)]
            unsafe fn mul_sub(self, factor: Self, sum: Self) -> Self {
                Self(std::array::from_fn(|l| {
                    let (a, b, c) = (self.0[l], factor.0[l], sum.0[l]);
                    if FUSED { (-a).mul_add(b, c) } else { c - a * b }
                }))
            }

            #[inline(always)]
            unsafe fn gather<const D: usize>(at: *const $sample, hop: usize, part: usize) -> Self {
                let lane = |l: usize| unsafe { *at.add((part + l) / D * hop + (part + l) % D) };
                Self(std::array::from_fn(lane))
            }

            #[inline(always)]
            unsafe fn spread<const D: usize>(row: *const $sample, n: usize, part: usize) -> Self {
                Self(std::array::from_fn(|l| unsafe { *row.add((part + l) / D * D + n) }))
            }
        }
    };
}

portable!(f32);
portable!(f64);

#[cfg(target_arch = "x86_64")]
impl ChannelVector for Avx2F32 {
    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    unsafe fn mul(self, factor: Self) -> Self {
        Self(unsafe { _mm256_mul_ps(self.0, factor.0) })
    }

    #[inline(always)]
    unsafe fn mul_sub(self, factor: Self, sum: Self) -> Self {
        Self(unsafe { _mm256_fnmadd_ps(self.0, factor.0, sum.0) })
    }

    #[inline(always)]
    unsafe fn gather<const D: usize>(at: *const f32, hop: usize, _: usize) -> Self {
        unsafe {
            let s = |segment: usize| at.add(segment * hop);
            Self(match D {
                1 => _mm256_setr_ps(*s(0), *s(1), *s(2), *s(3), *s(4), *s(5), *s(6), *s(7)),
                2 => {
                    let low = _mm_loadh_pd(_mm_load_sd(s(0).cast()), s(1).cast());
                    let high = _mm_loadh_pd(_mm_load_sd(s(2).cast()), s(3).cast());
                    _mm256_castpd_ps(_mm256_set_m128d(high, low))
                }
                4 => _mm256_set_m128(_mm_loadu_ps(at.add(hop)), _mm_loadu_ps(at)),
                _ => _mm256_loadu_ps(at),
            })
        }
    }

    #[inline(always)]
    unsafe fn spread<const D: usize>(row: *const f32, n: usize, _: usize) -> Self {
        unsafe {
            Self(match D {
                1 => _mm256_loadu_ps(row),
                2 if n == 0 => _mm256_moveldup_ps(_mm256_loadu_ps(row)),
                2 => _mm256_movehdup_ps(_mm256_loadu_ps(row)),
                4 => _mm256_permutevar_ps(_mm256_loadu_ps(row), _mm256_set1_epi32(n as i32)),
                _ => _mm256_set1_ps(*row.add(n)),
            })
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl ChannelVector for Avx2F64 {
    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        Self(unsafe { _mm256_add_pd(self.0, other.0) })
    }

    #[inline(always)]
    unsafe fn sub(self, other: Self) -> Self {
        Self(unsafe { _mm256_sub_pd(self.0, other.0) })
    }

    #[inline(always)]
    unsafe fn mul(self, factor: Self) -> Self {
        Self(unsafe { _mm256_mul_pd(self.0, factor.0) })
    }

    #[inline(always)]
    unsafe fn mul_sub(self, factor: Self, sum: Self) -> Self {
        Self(unsafe { _mm256_fnmadd_pd(self.0, factor.0, sum.0) })
    }

    #[inline(always)]
    unsafe fn gather<const D: usize>(at: *const f64, hop: usize, _: usize) -> Self {
        unsafe {
            let s = |segment: usize| at.add(segment * hop);
            Self(match D {
                1 => _mm256_setr_pd(*s(0), *s(1), *s(2), *s(3)),
                2 => _mm256_set_m128d(_mm_loadu_pd(at.add(hop)), _mm_loadu_pd(at)),
                _ => _mm256_loadu_pd(at),
            })
        }
    }

    #[inline(always)]
    unsafe fn spread<const D: usize>(row: *const f64, n: usize, _: usize) -> Self {
        unsafe {
            Self(match D {
                1 => _mm256_loadu_pd(row),
                2 if n == 0 => _mm256_movedup_pd(_mm256_loadu_pd(row)),
                2 => _mm256_permute_pd::<0b1111>(_mm256_loadu_pd(row)),
                _ => _mm256_set1_pd(*row.add(n)),
            })
        }
    }
}
