//! [`Lanes`] in the registers of AVX-512: two groups each.

use super::lanes::Lanes;
use std::arch::x86_64::*;

impl Lanes for __m512 {
    type Sample = f32;
    type Group = __m256;
    const GROUP: usize = 8;
    const GROUPS: usize = 2;
    const SUMS: usize = 24;

    #[inline(always)]
    unsafe fn zero() -> Self {
        unsafe { _mm512_setzero_ps() }
    }

    #[inline(always)]
    unsafe fn spread<const D: usize>(at: *const f32) -> Self {
        unsafe {
            match D {
                1 => _mm512_set1_ps(*at),
                2 => _mm512_castpd_ps(_mm512_set1_pd(at.cast::<f64>().read_unaligned())),
                4 => _mm512_broadcast_f32x4(_mm_loadu_ps(at)),
                _ => _mm512_broadcast_f32x8(_mm256_loadu_ps(at)),
            }
        }
    }

    #[inline(always)]
    unsafe fn windows<const D: usize>(at: *const f32, hop: usize) -> Self {
        unsafe {
            if D < 8 {
                return _mm512_loadu_ps(at);
            }
            let first = _mm512_castps256_ps512(_mm256_loadu_ps(at));
            _mm512_insertf32x8::<1>(first, _mm256_loadu_ps(at.add(hop)))
        }
    }

    #[inline(always)]
    unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
        unsafe { _mm512_fmadd_ps(self, factor, sum) }
    }

    #[inline(always)]
    unsafe fn group(self, index: usize) -> __m256 {
        unsafe { if index == 0 { _mm512_castps512_ps256(self) } else { _mm512_extractf32x8_ps::<1>(self) } }
    }
}

impl Lanes for __m512d {
    type Sample = f64;
    type Group = __m256d;
    const GROUP: usize = 4;
    const GROUPS: usize = 2;
    const SUMS: usize = 24;

    #[inline(always)]
    unsafe fn zero() -> Self {
        unsafe { _mm512_setzero_pd() }
    }

    #[inline(always)]
    unsafe fn spread<const D: usize>(at: *const f64) -> Self {
        unsafe {
            match D {
                1 => _mm512_set1_pd(*at),
                2 => _mm512_broadcast_f64x2(_mm_loadu_pd(at)),
                _ => _mm512_broadcast_f64x4(_mm256_loadu_pd(at)),
            }
        }
    }

    #[inline(always)]
    unsafe fn windows<const D: usize>(at: *const f64, hop: usize) -> Self {
        unsafe {
            if D < 4 {
                return _mm512_loadu_pd(at);
            }
            let first = _mm512_castpd256_pd512(_mm256_loadu_pd(at));
            _mm512_insertf64x4::<1>(first, _mm256_loadu_pd(at.add(hop)))
        }
    }

    #[inline(always)]
    unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
        unsafe { _mm512_fmadd_pd(self, factor, sum) }
    }

    #[inline(always)]
    unsafe fn group(self, index: usize) -> __m256d {
        unsafe { if index == 0 { _mm512_castpd512_pd256(self) } else { _mm512_extractf64x4_pd::<1>(self) } }
    }
}
