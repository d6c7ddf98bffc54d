//! Sums of phases to frames of outputs, in 256-bit registers: see [`Group::store_ticks`].
//!
//! Halves are stored as they are: a store takes either half of a register, while moving lanes across halves
//! would compete with the multiply-adds.

use super::convert::transpose4;
use super::lanes::Group;
use std::arch::x86_64::*;

/// See [`Group::store_ticks`].
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn store_ticks_f32<const P: usize, const D: usize>(
    [a, b, c, d]: [__m256; 4],
    out: *mut f32,
    hop: usize,
) {
    // SAFETY: writes what the caller vouches for.
    unsafe {
        match (P, D) {
            (2, 1) => {
                // Two ticks in each half: 0 1 and 4 5, 2 3 and 6 7.
                let (first, second) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
                store_pairs(low_f32(first), out, hop);
                store_pairs(low_f32(second), out.add(2 * hop), hop);
                store_pairs(high_f32(first), out.add(4 * hop), hop);
                store_pairs(high_f32(second), out.add(6 * hop), hop);
            }
            (_, 1) => {
                let quads = transpose4([a, b, c, d]);
                quads.into_iter().enumerate().for_each(|(t, q)| _mm_storeu_ps(out.add(t * hop), low_f32(q)));
                quads
                    .into_iter()
                    .enumerate()
                    .for_each(|(t, q)| _mm_storeu_ps(out.add((t + 4) * hop), high_f32(q)));
            }
            (2, 2) if hop == 2 => _mm256_storeu_ps(out, Group::diagonal_pairs(a, b)),
            (2, 2) => {
                let pairs: __m256 = Group::diagonal_pairs(a, b);
                store_pairs(low_f32(pairs), out, hop);
                store_pairs(high_f32(pairs), out.add(2 * hop), hop);
            }
            (_, 2) => {
                let first = _mm256_castps_pd(Group::diagonal_pairs(a, b));
                let last = _mm256_castps_pd(Group::diagonal_pairs(c, if P == 3 { c } else { d }));
                // Ticks 0 and 2, 1 and 3.
                let even = _mm256_castpd_ps(_mm256_unpacklo_pd(first, last));
                let odd = _mm256_castpd_ps(_mm256_unpackhi_pd(first, last));
                _mm_storeu_ps(out, low_f32(even));
                _mm_storeu_ps(out.add(hop), low_f32(odd));
                _mm_storeu_ps(out.add(2 * hop), high_f32(even));
                _mm_storeu_ps(out.add(3 * hop), high_f32(odd));
            }
            _ => {
                let quads: __m256 = if P == 3 {
                    Group::diagonal_halves([a, b, c, c])
                } else {
                    Group::diagonal_quads([a, b, c, d])
                };
                if P == 4 && hop == 4 {
                    return _mm256_storeu_ps(out, quads);
                }
                _mm_storeu_ps(out, low_f32(quads));
                _mm_storeu_ps(out.add(hop), high_f32(quads));
            }
        }
    }
}

/// See [`Group::store_halves`].
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn store_halves_f32(sums: [__m256; 4], out: [*mut f32; 2], hop: usize) {
    // SAFETY: writes what the caller vouches for.
    unsafe {
        let pairs = Group::diagonal_halves(sums);
        for (tick, pair) in [low_f32(pairs), high_f32(pairs)].into_iter().enumerate() {
            _mm_storel_pd(out[0].add(tick * hop).cast(), _mm_castps_pd(pair));
            _mm_storeh_pd(out[1].add(tick * hop).cast(), _mm_castps_pd(pair));
        }
    }
}

/// Two phases of two ticks.
#[target_feature(enable = "avx2,fma")]
#[inline]
unsafe fn store_pairs(pairs: __m128, out: *mut f32, hop: usize) {
    // SAFETY: the caller's.
    unsafe {
        if hop == 2 {
            return _mm_storeu_ps(out, pairs);
        }
        _mm_storel_pd(out.cast(), _mm_castps_pd(pairs));
        _mm_storeh_pd(out.add(hop).cast(), _mm_castps_pd(pairs));
    }
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn low_f32(x: __m256) -> __m128 {
    _mm256_castps256_ps128(x)
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn high_f32(x: __m256) -> __m128 {
    _mm256_extractf128_ps::<1>(x)
}

/// See [`Group::store_ticks`].
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn store_ticks_f64<const P: usize, const D: usize>(
    [a, b, c, d]: [__m256d; 4],
    out: *mut f64,
    hop: usize,
) {
    // SAFETY: writes what the caller vouches for.
    unsafe {
        match (P, D) {
            (2, 1) => {
                // Ticks 0 and 2, 1 and 3.
                let (even, odd) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
                store_both_f64(even, [out, out.add(2 * hop)]);
                store_both_f64(odd, [out.add(hop), out.add(3 * hop)]);
            }
            (_, 1) => {
                // Ticks 0 and 2, 1 and 3 of each two phases; in order, because of the place behind three.
                let even = quads_f64(_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
                let odd = quads_f64(_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d));
                for (t, quad) in [even[0], odd[0], even[1], odd[1]].into_iter().enumerate() {
                    _mm256_storeu_pd(out.add(t * hop), quad);
                }
            }
            (2, 2) if hop == 2 => _mm256_storeu_pd(out, Group::diagonal_pairs(a, b)),
            (2, 2) => store_both_f64(Group::diagonal_pairs(a, b), [out, out.add(hop)]),
            (_, 2) => {
                let first: __m256d = Group::diagonal_pairs(a, b);
                let last = Group::diagonal_pairs(c, if P == 3 { c } else { d });
                for (t, quad) in quads_f64(first, last).into_iter().enumerate() {
                    _mm256_storeu_pd(out.add(t * hop), quad);
                }
            }
            (3, _) => _mm256_storeu_pd(out, Group::diagonal_halves([a, b, c, c])),
            _ => _mm256_storeu_pd(out, Group::diagonal_quads([a, b, c, d])),
        }
    }
}

/// See [`Group::store_halves`].
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn store_halves_f64(sums: [__m256d; 4], out: [*mut f64; 2]) {
    // SAFETY: the caller's.
    unsafe { store_both_f64(Group::diagonal_halves(sums), out) }
}

/// Two ticks, from their first two and their last two phases with a tick in each half.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn quads_f64(first: __m256d, last: __m256d) -> [__m256d; 2] {
    [_mm256_permute2f128_pd::<0x20>(first, last), _mm256_permute2f128_pd::<0x31>(first, last)]
}

/// Each half to a place of its own.
#[target_feature(enable = "avx2,fma")]
#[inline]
unsafe fn store_both_f64(halves: __m256d, [low, high]: [*mut f64; 2]) {
    // SAFETY: the caller's.
    unsafe {
        _mm_storeu_pd(low, _mm256_castpd256_pd128(halves));
        _mm_storeu_pd(high, _mm256_extractf128_pd::<1>(halves));
    }
}
