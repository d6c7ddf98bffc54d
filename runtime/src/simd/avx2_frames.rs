//! Sums of lanes, and outputs from sums of phases to frames, in registers of AVX2.

use std::arch::x86_64::*;

/// Hides where a value comes from, or else the compiler makes horizontal adds of two shuffles and an add,
/// which processors split into four slow operations.
macro_rules! opaque {
    ($value:expr) => {{
        #[allow(unused_mut)]
        let mut value = $value;
        #[cfg(not(miri))]
        // SAFETY: an empty instruction.
        unsafe {
            std::arch::asm!("/* {0} */", inout(ymm_reg) value, options(pure, nomem, nostack, preserves_flags));
        }
        value
    }};
}

/// For each two lanes: a0 + a1, b0 + b1.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn neighbours_f32(a: __m256, b: __m256) -> __m256 {
    let mixed = opaque!(_mm256_blend_ps::<0b1010_1010>(b, a));
    _mm256_add_ps(_mm256_blend_ps::<0b1010_1010>(a, b), _mm256_permute_ps::<0b10_11_00_01>(mixed))
}

/// As [`neighbours_f32`].
#[target_feature(enable = "avx2,fma")]
#[inline]
fn neighbours_f64(a: __m256d, b: __m256d) -> __m256d {
    let mixed = opaque!(_mm256_blend_pd::<0b1010>(b, a));
    _mm256_add_pd(_mm256_blend_pd::<0b1010>(a, b), _mm256_permute_pd::<0b0101>(mixed))
}

/// For each four lanes: a0 + a2, a1 + a3, c2 + c0, c3 + c1.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn far_f32(a: __m256, c: __m256) -> __m256 {
    _mm256_add_ps(_mm256_blend_ps::<0b1100_1100>(a, c), _mm256_shuffle_ps::<0b01_00_11_10>(a, c))
}

/// As [`far_f32`].
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn far_f64(a: __m256d, c: __m256d) -> __m256d {
    _mm256_add_pd(_mm256_blend_pd::<0b1100>(a, c), _mm256_permute2f128_pd::<0x21>(a, c))
}

/// For each four lanes: the sum of those of a, of b, of c, of d.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn quads_f32([a, b, c, d]: [__m256; 4]) -> __m256 {
    neighbours_f32(far_f32(a, c), far_f32(b, d))
}

/// As [`quads_f32`].
#[target_feature(enable = "avx2,fma")]
#[inline]
fn quads_f64([a, b, c, d]: [__m256d; 4]) -> __m256d {
    neighbours_f64(far_f64(a, c), far_f64(b, d))
}

#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn sum_frames_f32<const D: usize>(v: impl Fn(usize) -> __m256) -> __m256 {
    match D {
        1 => v(0),
        2 => {
            // Frames 0 4 1 5 2 6 3 7.
            let mixed = neighbours_f32(v(0), v(1));
            _mm256_permutevar8x32_ps(mixed, _mm256_setr_epi32(0, 2, 4, 6, 1, 3, 5, 7))
        }
        4 => {
            // Frames 0 2 4 6 1 3 5 7.
            let mixed = quads_f32([v(0), v(1), v(2), v(3)]);
            _mm256_permutevar8x32_ps(mixed, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7))
        }
        _ => {
            let (a, b) = (quads_f32([v(0), v(1), v(2), v(3)]), quads_f32([v(4), v(5), v(6), v(7)]));
            _mm256_add_ps(_mm256_permute2f128_ps::<0x20>(a, b), _mm256_permute2f128_ps::<0x31>(a, b))
        }
    }
}

#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn sum_frames_f64<const D: usize>(v: impl Fn(usize) -> __m256d) -> __m256d {
    match D {
        1 => v(0),
        // Frames 0 2 1 3.
        2 => _mm256_permute4x64_pd::<0b11_01_10_00>(neighbours_f64(v(0), v(1))),
        _ => quads_f64([v(0), v(1), v(2), v(3)]),
    }
}

#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn low(x: __m256) -> __m128 {
    _mm256_castps256_ps128(x)
}

#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn high(x: __m256) -> __m128 {
    _mm256_extractf128_ps::<1>(x)
}

/// Two phases of two frames.
///
/// # Safety
/// Writes two samples to `out` and two to `out + hop`.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn store_pairs(pairs: __m128, out: [*mut f32; 2]) {
    _mm_storel_pd(out[0].cast(), _mm_castps_pd(pairs));
    _mm_storeh_pd(out[1].cast(), _mm_castps_pd(pairs));
}

/// Both halves, each to a place of its own.
///
/// # Safety
/// Writes two samples to each place.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn store_both(halves: __m256d, out: [*mut f64; 2]) {
    _mm_storeu_pd(out[0], _mm256_castpd256_pd128(halves));
    _mm_storeu_pd(out[1], _mm256_extractf128_pd::<1>(halves));
}

/// [`Vector::store_frames`](super::vector::Vector::store_frames). Halves are stored as they are: a store
/// takes either half of a register, while moving lanes across halves would compete with the multiply-adds.
///
/// # Safety
/// As there.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn store_frames_f32<const P: usize, const D: usize>(
    sums: [__m256; 4],
    out: *mut f32,
    hop: usize,
) {
    let [a, b, c, d] = sums;
    let pairs = |a, b| _mm256_add_ps(a, _mm256_permute_ps::<0b10_11_00_01>(b));
    let at = |frame: usize| out.add(frame * hop);
    match (P, D) {
        (2, 1) => {
            // Two frames in each half: 0 1 and 4 5, 2 3 and 6 7.
            let (first, second) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let quarters = [low(first), low(second), high(first), high(second)];
            for (frames, quarter) in quarters.into_iter().enumerate() {
                if hop == 2 {
                    _mm_storeu_ps(at(2 * frames), quarter);
                } else {
                    store_pairs(quarter, [at(2 * frames), at(2 * frames + 1)]);
                }
            }
        }
        (_, 1) => {
            let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
            // Frames t and t + 4.
            let frames = [
                _mm256_shuffle_ps::<0x44>(ab_low, cd_low),
                _mm256_shuffle_ps::<0xEE>(ab_low, cd_low),
                _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
                _mm256_shuffle_ps::<0xEE>(ab_high, cd_high),
            ];
            for (t, both) in frames.into_iter().enumerate() {
                _mm_storeu_ps(at(t), low(both));
            }
            for (t, both) in frames.into_iter().enumerate() {
                _mm_storeu_ps(at(t + 4), high(both));
            }
        }
        (2, 2) if hop == 2 => _mm256_storeu_ps(out, pairs(a, b)),
        (2, 2) => {
            store_pairs(low(pairs(a, b)), [at(0), at(1)]);
            store_pairs(high(pairs(a, b)), [at(2), at(3)]);
        }
        (_, 2) => {
            let first = _mm256_castps_pd(pairs(a, b));
            let last = _mm256_castps_pd(pairs(c, if P == 3 { c } else { d }));
            // Frames 0 and 2, 1 and 3.
            let even = _mm256_castpd_ps(_mm256_unpacklo_pd(first, last));
            let odd = _mm256_castpd_ps(_mm256_unpackhi_pd(first, last));
            for (t, frame) in [low(even), low(odd), high(even), high(odd)].into_iter().enumerate() {
                _mm_storeu_ps(at(t), frame);
            }
        }
        _ => {
            let quads = match P {
                3 => pairs(far_f32(a, c), far_f32(b, c)),
                _ => diagonal_quads_f32(sums),
            };
            if P == 4 && hop == 4 {
                return _mm256_storeu_ps(out, quads);
            }
            _mm_storeu_ps(at(0), low(quads));
            _mm_storeu_ps(at(1), high(quads));
        }
    }
}

#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) fn diagonal_quads_f32([a, b, c, d]: [__m256; 4]) -> __m256 {
    let two = |a, c| _mm256_add_ps(a, _mm256_permute_ps::<0b01_00_11_10>(c));
    _mm256_add_ps(two(a, c), _mm256_permute_ps::<0b10_01_00_11>(two(b, d)))
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn diagonal_quads_f64([a, b, c, d]: [__m256d; 4]) -> __m256d {
    let two = |a, c| _mm256_add_pd(a, _mm256_permute4x64_pd::<0b01_00_11_10>(c));
    _mm256_add_pd(two(a, c), _mm256_permute4x64_pd::<0b10_01_00_11>(two(b, d)))
}

/// As [`store_frames_f32`].
///
/// # Safety
/// As for [`Vector::store_frames`](super::vector::Vector::store_frames).
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn store_frames_f64<const P: usize, const D: usize>(
    sums: [__m256d; 4],
    out: *mut f64,
    hop: usize,
) {
    let [a, b, c, d] = sums;
    let pairs = |a, b| _mm256_add_pd(a, _mm256_permute_pd::<0b0101>(b));
    // Two frames, from their first two and their last two phases with a frame in each half.
    let frames = |first, last| {
        [_mm256_permute2f128_pd::<0x20>(first, last), _mm256_permute2f128_pd::<0x31>(first, last)]
    };
    let at = |frame: usize| out.add(frame * hop);
    match (P, D) {
        (2, 1) => {
            // Frames 0 and 2, 1 and 3.
            store_both(_mm256_unpacklo_pd(a, b), [at(0), at(2)]);
            store_both(_mm256_unpackhi_pd(a, b), [at(1), at(3)]);
        }
        (_, 1) => {
            // In order, because of the place after three.
            let even = frames(_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
            let odd = frames(_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d));
            for (t, quad) in [even[0], odd[0], even[1], odd[1]].into_iter().enumerate() {
                _mm256_storeu_pd(at(t), quad);
            }
        }
        (2, 2) if hop == 2 => _mm256_storeu_pd(out, pairs(a, b)),
        (2, 2) => store_both(pairs(a, b), [at(0), at(1)]),
        (_, 2) => {
            let last = pairs(c, if P == 3 { c } else { d });
            for (t, quad) in frames(pairs(a, b), last).into_iter().enumerate() {
                _mm256_storeu_pd(at(t), quad);
            }
        }
        (3, _) => _mm256_storeu_pd(out, pairs(far_f64(a, c), far_f64(b, c))),
        _ => _mm256_storeu_pd(out, diagonal_quads_f64(sums)),
    }
}
