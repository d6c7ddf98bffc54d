//! AVX-512: two lane groups are one register, and outputs are stored as whole registers where frames follow
//! each other.

use super::avx2::{Avx2F32, Avx2F64, each, register};
use super::vector::Vector;
use std::arch::x86_64::*;

/// Sixteen lanes of f32.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx512F32(__m512);

/// Eight lanes of f64.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Avx512F64(__m512d);

/// The four quarters of a register to places `hop` apart.
///
/// # Safety
/// Writes four samples to each place.
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
unsafe fn store_quarters(x: __m512, out: *mut f32, hop: usize) {
    if hop == 4 {
        return _mm512_storeu_ps(out, x);
    }
    _mm_storeu_ps(out, _mm512_castps512_ps128(x));
    _mm_storeu_ps(out.add(hop), _mm512_extractf32x4_ps::<1>(x));
    _mm_storeu_ps(out.add(2 * hop), _mm512_extractf32x4_ps::<2>(x));
    _mm_storeu_ps(out.add(3 * hop), _mm512_extractf32x4_ps::<3>(x));
}

/// Samples of a and b in turns: two registers.
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
fn zip_f64(a: __m512d, b: __m512d) -> [__m512d; 2] {
    [
        _mm512_permutex2var_pd(a, _mm512_setr_epi64(0, 8, 1, 9, 2, 10, 3, 11), b),
        _mm512_permutex2var_pd(a, _mm512_setr_epi64(4, 12, 5, 13, 6, 14, 7, 15), b),
    ]
}

/// As [`zip_f64`].
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
fn zip_f32(a: __m512, b: __m512) -> [__m512; 2] {
    let first = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
    let second = _mm512_setr_epi32(8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
    [_mm512_permutex2var_ps(a, first, b), _mm512_permutex2var_ps(a, second, b)]
}

/// Pairs of samples of a and b in turns: two registers.
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
fn zip_pairs_f64(a: __m512d, b: __m512d) -> [__m512d; 2] {
    [
        _mm512_permutex2var_pd(a, _mm512_setr_epi64(0, 1, 8, 9, 2, 3, 10, 11), b),
        _mm512_permutex2var_pd(a, _mm512_setr_epi64(4, 5, 12, 13, 6, 7, 14, 15), b),
    ]
}

/// As [`zip_pairs_f64`].
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
fn zip_pairs_f32(a: __m512, b: __m512) -> [__m512; 2] {
    let [first, second] = zip_f64(_mm512_castps_pd(a), _mm512_castps_pd(b));
    [_mm512_castpd_ps(first), _mm512_castpd_ps(second)]
}

/// [`Vector::store_frames`] for the shapes whose outputs fill registers; false, with nothing done, for the
/// others.
///
/// # Safety
/// As there.
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
unsafe fn store_frames_f32<const P: usize, const D: usize>(
    sums: [__m512; 4],
    out: *mut f32,
    hop: usize,
) -> bool {
    let [a, b, c, d] = sums;
    let pairs = |a, b| _mm512_add_ps(a, _mm512_permute_ps::<0b10_11_00_01>(b));
    match (P, D) {
        (2, 1) if hop == 2 => {
            let [first, second] = zip_f32(a, b);
            _mm512_storeu_ps(out, first);
            _mm512_storeu_ps(out.add(16), second);
        }
        (2, 2) if hop == 2 => _mm512_storeu_ps(out, pairs(a, b)),
        (4, 1) => {
            let (ab, cd) = (zip_f32(a, b), zip_f32(c, d));
            for half in 0..2 {
                let [first, second] = zip_pairs_f32(ab[half], cd[half]);
                store_quarters(first, out.add(8 * half * hop), hop);
                store_quarters(second, out.add((8 * half + 4) * hop), hop);
            }
        }
        (4, 2) => {
            let [first, second] = zip_pairs_f32(pairs(a, b), pairs(c, d));
            store_quarters(first, out, hop);
            store_quarters(second, out.add(4 * hop), hop);
        }
        (4, 4) => store_quarters(diagonal_quads_f32(sums), out, hop),
        _ => return false,
    }
    true
}

#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
fn diagonal_quads_f32([a, b, c, d]: [__m512; 4]) -> __m512 {
    let two = |a, c| _mm512_add_ps(a, _mm512_permute_ps::<0b01_00_11_10>(c));
    _mm512_add_ps(two(a, c), _mm512_permute_ps::<0b10_01_00_11>(two(b, d)))
}

#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
fn diagonal_halves_f32([a, b, c, d]: [__m512; 4]) -> __m512 {
    let far = |a, c| {
        _mm512_add_ps(
            _mm512_mask_blend_ps(0b1100_1100_1100_1100, a, c),
            _mm512_shuffle_ps::<0b01_00_11_10>(a, c),
        )
    };
    _mm512_add_ps(far(a, c), _mm512_permute_ps::<0b10_11_00_01>(far(b, d)))
}

/// As [`store_frames_f32`].
///
/// # Safety
/// As for [`Vector::store_frames`].
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma")]
#[inline]
unsafe fn store_frames_f64<const P: usize, const D: usize>(
    [a, b, c, d]: [__m512d; 4],
    out: *mut f64,
    hop: usize,
) -> bool {
    let pairs = |a, b| _mm512_add_pd(a, _mm512_permute_pd::<0b0101_0101>(b));
    match (P, D) {
        (2, 1) if hop == 2 => {
            let [first, second] = zip_f64(a, b);
            _mm512_storeu_pd(out, first);
            _mm512_storeu_pd(out.add(8), second);
        }
        (2, 2) if hop == 2 => _mm512_storeu_pd(out, pairs(a, b)),
        (4, 1) if hop == 4 => {
            let (ab, cd) = (zip_f64(a, b), zip_f64(c, d));
            for half in 0..2 {
                let [first, second] = zip_pairs_f64(ab[half], cd[half]);
                _mm512_storeu_pd(out.add(16 * half), first);
                _mm512_storeu_pd(out.add(16 * half + 8), second);
            }
        }
        (4, 2) if hop == 4 => {
            let [first, second] = zip_pairs_f64(pairs(a, b), pairs(c, d));
            _mm512_storeu_pd(out, first);
            _mm512_storeu_pd(out.add(8), second);
        }
        (4, 4) if hop == 4 => {
            let two = |a, c| _mm512_add_pd(a, _mm512_permutex_pd::<0b01_00_11_10>(c));
            let quads = _mm512_add_pd(two(a, c), _mm512_permutex_pd::<0b10_01_00_11>(two(b, d)));
            _mm512_storeu_pd(out, quads);
        }
        _ => return false,
    }
    true
}

/// [`Vector::store_frames`] group after group.
macro_rules! store_groups {
    ($group:ty, $sums:ident, $out:ident, $hop:ident) => {
        for g in 0..2 {
            let frames = <$group>::LANES / D;
            let groups = each($sums, |sum| sum.group(g));
            <$group>::store_frames::<P, D>(groups, $out.add(g * frames * $hop), $hop);
        }
    };
}

impl Avx512F32 {
    /// One of the two groups.
    #[inline(always)]
    fn group(self, index: usize) -> Avx2F32 {
        // SAFETY: a vector exists only where its instructions do.
        Avx2F32(unsafe {
            if index == 0 { _mm512_castps512_ps256(self.0) } else { _mm512_extractf32x8_ps::<1>(self.0) }
        })
    }
}

impl Vector for Avx512F32 {
    type Sample = f32;
    const LANES: usize = 16;
    // Of 32 registers: 24 sums, and the fewer of inputs and coefficients.
    const SUMS: usize = 24;

    register!(_mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps _mm512_add_ps _mm512_fmadd_ps);

    #[inline(always)]
    fn finite(self) -> bool {
        // x - x is 0 only if x is finite.
        // SAFETY: a vector exists only where its instructions do.
        unsafe {
            let zero = _mm512_sub_ps(self.0, self.0);
            _mm512_cmp_ps_mask::<_CMP_NEQ_UQ>(zero, _mm512_setzero_ps()) == 0
        }
    }

    #[inline(always)]
    unsafe fn broadcast<const D: usize>(at: *const f32) -> Self {
        Self(match D {
            1 => _mm512_set1_ps(*at),
            2 => _mm512_castpd_ps(_mm512_set1_pd(at.cast::<f64>().read_unaligned())),
            4 => _mm512_broadcast_f32x4(_mm_loadu_ps(at)),
            _ => _mm512_broadcast_f32x8(_mm256_loadu_ps(at)),
        })
    }

    #[inline(always)]
    unsafe fn frames<const D: usize>(at: *const f32, hop: usize) -> Self {
        if D < 8 || hop == 8 {
            return Self(_mm512_loadu_ps(at));
        }
        let first = _mm512_castps256_ps512(_mm256_loadu_ps(at));
        Self(_mm512_insertf32x8::<1>(first, _mm256_loadu_ps(at.add(hop))))
    }

    #[inline(always)]
    fn diagonal_quads(sums: [Self; 4]) -> Self {
        // SAFETY: a vector exists only where its instructions do.
        Self(unsafe { diagonal_quads_f32(each(sums, |sum| sum.0)) })
    }

    #[inline(always)]
    fn diagonal_halves(sums: [Self; 4]) -> Self {
        // SAFETY: a vector exists only where its instructions do.
        Self(unsafe { diagonal_halves_f32(each(sums, |sum| sum.0)) })
    }

    #[inline(always)]
    unsafe fn store_frames<const P: usize, const D: usize>(sums: [Self; 4], out: *mut f32, hop: usize) {
        if !store_frames_f32::<P, D>(each(sums, |sum| sum.0), out, hop) {
            store_groups!(Avx2F32, sums, out, hop);
        }
    }

    #[inline(always)]
    unsafe fn store_halves(sums: [Self; 4], out: [*mut f32; 2], hop: usize) {
        let halves = Self::diagonal_halves(sums);
        if hop == 2 {
            let order = _mm512_setr_epi64(0, 2, 4, 6, 1, 3, 5, 7);
            let both = Self(_mm512_castpd_ps(_mm512_permutexvar_pd(order, _mm512_castps_pd(halves.0))));
            both.group(0).store(out[0]);
            return both.group(1).store(out[1]);
        }
        for g in 0..2 {
            let pairs = halves.group(g);
            pairs.store_two_halves([out[0].add(2 * g * hop), out[1].add(2 * g * hop)], hop);
        }
    }

    #[inline(always)]
    unsafe fn add_halves(sums: *const f32, vectors: usize, out: *mut f32, hop: usize) {
        for pair in 0..vectors / 2 {
            let from = sums.add(32 * pair);
            let (u, v) = (_mm512_loadu_ps(from), _mm512_loadu_ps(from.add(16)));
            let lower = _mm512_shuffle_f32x4::<0b10_00_10_00>(u, v);
            let upper = _mm512_shuffle_f32x4::<0b11_01_11_01>(u, v);
            store_quarters(_mm512_add_ps(lower, upper), out.add(4 * pair * hop), hop);
        }
        if vectors % 2 == 1 {
            let last = vectors - 1;
            Avx2F32::add_halves(sums.add(16 * last), 2, out.add(2 * last * hop), hop);
        }
    }
}

impl Avx512F64 {
    /// One of the two groups.
    #[inline(always)]
    fn group(self, index: usize) -> Avx2F64 {
        // SAFETY: a vector exists only where its instructions do.
        Avx2F64(unsafe {
            if index == 0 { _mm512_castpd512_pd256(self.0) } else { _mm512_extractf64x4_pd::<1>(self.0) }
        })
    }
}

impl Vector for Avx512F64 {
    type Sample = f64;
    const LANES: usize = 8;
    const SUMS: usize = 24;

    register!(_mm512_set1_pd _mm512_loadu_pd _mm512_storeu_pd _mm512_add_pd _mm512_fmadd_pd);

    #[inline(always)]
    fn finite(self) -> bool {
        // x - x is 0 only if x is finite.
        // SAFETY: a vector exists only where its instructions do.
        unsafe {
            let zero = _mm512_sub_pd(self.0, self.0);
            _mm512_cmp_pd_mask::<_CMP_NEQ_UQ>(zero, _mm512_setzero_pd()) == 0
        }
    }

    #[inline(always)]
    unsafe fn broadcast<const D: usize>(at: *const f64) -> Self {
        Self(match D {
            1 => _mm512_set1_pd(*at),
            2 => _mm512_broadcast_f64x2(_mm_loadu_pd(at)),
            _ => _mm512_broadcast_f64x4(_mm256_loadu_pd(at)),
        })
    }

    #[inline(always)]
    unsafe fn frames<const D: usize>(at: *const f64, hop: usize) -> Self {
        if D < 4 || hop == 4 {
            return Self(_mm512_loadu_pd(at));
        }
        let first = _mm512_castpd256_pd512(_mm256_loadu_pd(at));
        Self(_mm512_insertf64x4::<1>(first, _mm256_loadu_pd(at.add(hop))))
    }

    #[inline(always)]
    unsafe fn store_frames<const P: usize, const D: usize>(sums: [Self; 4], out: *mut f64, hop: usize) {
        if !store_frames_f64::<P, D>(each(sums, |sum| sum.0), out, hop) {
            store_groups!(Avx2F64, sums, out, hop);
        }
    }

    #[inline(always)]
    unsafe fn store_halves(sums: [Self; 4], out: [*mut f64; 2], hop: usize) {
        for g in 0..2 {
            Avx2F64::store_halves(
                each(sums, |sum| sum.group(g)),
                [out[0].add(g * hop), out[1].add(g * hop)],
                hop,
            );
        }
    }
}
