//! AVX2 and FMA: one lane group is one register.

use super::avx2_frames::{
    diagonal_quads_f32, far_f32, far_f64, high, low, store_both, store_frames_f32, store_frames_f64,
    store_pairs, sum_frames_f32, sum_frames_f64,
};
use super::vector::Vector;
use std::arch::x86_64::*;

/// Eight lanes of f32.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2F32(pub(super) __m256);

/// Four lanes of f64.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx2F64(pub(super) __m256d);

/// The memory access and arithmetic of a register of x86.
macro_rules! register {
    ($splat:ident $load:ident $store:ident $add:ident $fmadd:ident) => {
        #[inline(always)]
        unsafe fn splat(value: Self::Sample) -> Self {
            Self($splat(value))
        }

        #[inline(always)]
        unsafe fn load(at: *const Self::Sample) -> Self {
            Self($load(at))
        }

        #[inline(always)]
        unsafe fn store(self, at: *mut Self::Sample) {
            $store(at, self.0)
        }

        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: a vector exists only where its instructions do.
            Self(unsafe { $add(self.0, other.0) })
        }

        #[inline(always)]
        fn mul_add(self, factor: Self, sum: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { $fmadd(self.0, factor.0, sum.0) })
        }
    };
}
pub(super) use register;

/// `of` of each of four sums. Compilers leave `array::map` a call, before which all registers go to memory.
#[inline(always)]
pub(super) fn each<V, R>([a, b, c, d]: [V; 4], of: impl Fn(V) -> R) -> [R; 4] {
    [of(a), of(b), of(c), of(d)]
}

impl Vector for Avx2F32 {
    type Sample = f32;
    const LANES: usize = 8;
    // Of 16 registers: 12 sums, 3 inputs and a coefficient.
    const SUMS: usize = 12;

    register!(_mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps _mm256_add_ps _mm256_fmadd_ps);

    #[inline(always)]
    fn finite(self) -> bool {
        // x - x is 0 only if x is finite.
        // SAFETY: a vector exists only where its instructions do.
        unsafe {
            let zero = _mm256_sub_ps(self.0, self.0);
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_NEQ_UQ>(zero, _mm256_setzero_ps())) == 0
        }
    }

    #[inline(always)]
    unsafe fn broadcast<const D: usize>(at: *const f32) -> Self {
        Self(match D {
            1 => _mm256_set1_ps(*at),
            2 => _mm256_castpd_ps(_mm256_set1_pd(at.cast::<f64>().read_unaligned())),
            4 => _mm256_broadcast_ps(&at.cast::<__m128>().read_unaligned()),
            _ => _mm256_loadu_ps(at),
        })
    }

    #[inline(always)]
    fn diagonal_quads(sums: [Self; 4]) -> Self {
        // SAFETY: a vector exists only where its instructions do.
        Self(unsafe { diagonal_quads_f32(each(sums, |sum| sum.0)) })
    }

    #[inline(always)]
    fn diagonal_halves([a, b, c, d]: [Self; 4]) -> Self {
        // SAFETY: a vector exists only where its instructions do.
        Self(unsafe {
            let (even, odd) = (far_f32(a.0, c.0), far_f32(b.0, d.0));
            _mm256_add_ps(even, _mm256_permute_ps::<0b10_11_00_01>(odd))
        })
    }

    #[inline(always)]
    fn sum_frames<const D: usize>(vectors: impl Fn(usize) -> Self) -> Self {
        // SAFETY: a vector exists only where its instructions do.
        Self(unsafe { sum_frames_f32::<D>(|v| vectors(v).0) })
    }

    #[inline(always)]
    unsafe fn store_frames<const P: usize, const D: usize>(sums: [Self; 4], out: *mut f32, hop: usize) {
        store_frames_f32::<P, D>(each(sums, |sum| sum.0), out, hop)
    }

    #[inline(always)]
    unsafe fn store_halves(sums: [Self; 4], out: [*mut f32; 2], hop: usize) {
        Self::diagonal_halves(sums).store_two_halves(out, hop)
    }
}

impl Avx2F32 {
    /// Two frames of [`Vector::store_halves`], whose sums are `self`.
    ///
    /// # Safety
    /// As there.
    #[inline(always)]
    pub(super) unsafe fn store_two_halves(self, out: [*mut f32; 2], hop: usize) {
        store_pairs(low(self.0), out);
        store_pairs(high(self.0), [out[0].add(hop), out[1].add(hop)]);
    }
}

impl Vector for Avx2F64 {
    type Sample = f64;
    const LANES: usize = 4;
    const SUMS: usize = 12;

    register!(_mm256_set1_pd _mm256_loadu_pd _mm256_storeu_pd _mm256_add_pd _mm256_fmadd_pd);

    #[inline(always)]
    fn finite(self) -> bool {
        // x - x is 0 only if x is finite.
        // SAFETY: a vector exists only where its instructions do.
        unsafe {
            let zero = _mm256_sub_pd(self.0, self.0);
            _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_NEQ_UQ>(zero, _mm256_setzero_pd())) == 0
        }
    }

    #[inline(always)]
    unsafe fn broadcast<const D: usize>(at: *const f64) -> Self {
        Self(match D {
            1 => _mm256_set1_pd(*at),
            2 => _mm256_broadcast_pd(&at.cast::<__m128d>().read_unaligned()),
            _ => _mm256_loadu_pd(at),
        })
    }

    #[inline(always)]
    fn sum_frames<const D: usize>(vectors: impl Fn(usize) -> Self) -> Self {
        // SAFETY: a vector exists only where its instructions do.
        Self(unsafe { sum_frames_f64::<D>(|v| vectors(v).0) })
    }

    #[inline(always)]
    unsafe fn store_frames<const P: usize, const D: usize>(sums: [Self; 4], out: *mut f64, hop: usize) {
        store_frames_f64::<P, D>(each(sums, |sum| sum.0), out, hop)
    }

    #[inline(always)]
    unsafe fn store_halves([a, b, c, d]: [Self; 4], out: [*mut f64; 2], _: usize) {
        let (even, odd) = (far_f64(a.0, c.0), far_f64(b.0, d.0));
        store_both(_mm256_add_pd(even, _mm256_permute_pd::<0b0101>(odd)), out);
    }
}
