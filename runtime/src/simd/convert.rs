//! Bytes to f32 and back, and frames from rows, with AVX2.
//!
//! N rows become frames of N samples by transposing 8 x 8 (or 4 x 4, or 2 x 8) blocks in registers. For N
//! that is no power of two a block writes past its frame, and the next frame overwrites what
//! means nothing. The last frames, where that would leave the slice, are left to the caller.

use std::arch::x86_64::*;

/// Samples of a format, eight at a time.
pub(super) trait Load: Copy {
    /// Bytes a sample.
    const BYTES: usize;
    unsafe fn load8(at: *const u8) -> __m256;
}

#[derive(Clone, Copy)]
pub(super) struct F32;
#[derive(Clone, Copy)]
pub(super) struct S16;
#[derive(Clone, Copy)]
pub(super) struct S32;

impl Load for F32 {
    const BYTES: usize = 4;

    #[inline(always)]
    unsafe fn load8(at: *const u8) -> __m256 {
        unsafe { _mm256_loadu_ps(at.cast()) }
    }
}

impl Load for S16 {
    const BYTES: usize = 2;

    #[inline(always)]
    unsafe fn load8(at: *const u8) -> __m256 {
        unsafe {
            let wide = _mm256_cvtepi16_epi32(_mm_loadu_si128(at.cast()));
            _mm256_mul_ps(_mm256_cvtepi32_ps(wide), _mm256_set1_ps(1.0 / 32768.0))
        }
    }
}

impl Load for S32 {
    const BYTES: usize = 4;

    #[inline(always)]
    unsafe fn load8(at: *const u8) -> __m256 {
        unsafe {
            let wide = _mm256_loadu_si256(at.cast());
            _mm256_mul_ps(_mm256_cvtepi32_ps(wide), _mm256_set1_ps(1.0 / 2147483648.0))
        }
    }
}

/// Where rows lie: `stride` samples apart.
#[derive(Clone, Copy)]
pub(super) struct Rows {
    pub(super) first: *const f32,
    pub(super) stride: usize,
}

impl Rows {
    #[inline(always)]
    unsafe fn at(self, row: usize, frame: usize) -> *const f32 {
        unsafe { self.first.add(row * self.stride + frame) }
    }
}

/// Decodes whole vectors; returns the samples done (a multiple of 8).
///
/// # Safety
/// AVX2.
#[inline(always)]
pub(super) unsafe fn decode<L: Load>(bytes: &[u8], out: &mut [f32]) -> usize {
    let (blocks, _) = out.as_chunks_mut::<32>();
    let mut done = 0;
    for (out, bytes) in blocks.iter_mut().zip(bytes.chunks_exact(32 * L::BYTES)) {
        for (v, out) in out.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            // SAFETY: the caller's; both slices hold 32 samples.
            unsafe { _mm256_storeu_ps(out.as_mut_ptr(), L::load8(bytes.as_ptr().add(8 * v * L::BYTES))) };
        }
        done += 32;
    }
    let rest = out[done..].as_chunks_mut::<8>().0.iter_mut();
    for (out, bytes) in rest.zip(bytes[done * L::BYTES..].chunks_exact(8 * L::BYTES)) {
        // SAFETY: the caller's; both slices hold eight samples.
        unsafe { _mm256_storeu_ps(out.as_mut_ptr(), L::load8(bytes.as_ptr())) };
        done += 8;
    }
    done
}

/// Samples that the last frame of a block is written as.
#[inline(always)]
fn reach(n: usize) -> usize {
    match n {
        1 | 2 => n,
        3 | 4 => 4,
        _ => n.max(8),
    }
}

/// Blocks of 8 frames of `size` units whose last frame, `reach` units long, ends within `len`.
#[inline(always)]
fn blocks(frames: usize, len: usize, size: usize, reach: usize) -> usize {
    let whole = frames / 8;
    let fits = |blocks: usize| blocks == 0 || (8 * blocks - 1) * size + reach <= len;
    if fits(whole) { whole } else { whole - 1 }
}

/// Interleaved frames of `m` samples from rows; returns the frames done (the last few may be left).
///
/// # Safety
/// AVX2; `out` has room for `frames` frames; each of the m rows has `frames` samples rounded up to 8.
#[inline(always)]
pub(super) unsafe fn interleave(rows: Rows, m: usize, frames: usize, out: &mut [f32]) -> usize {
    let blocks = blocks(frames, out.len(), m, reach(m));
    // SAFETY: block b writes from `8 b m` on and no further than `out`, see `blocks`.
    unsafe {
        let out = out.as_mut_ptr();
        let to = |b: usize| out.add(8 * b * m);
        match m {
            1 => (0..blocks).for_each(|b| _mm256_storeu_ps(to(b), _mm256_loadu_ps(rows.at(0, 8 * b)))),
            2 => (0..blocks).for_each(|b| interleave_pairs(rows, 8 * b, to(b))),
            3 | 4 => (0..blocks).for_each(|b| interleave_fours(rows, m, 8 * b, to(b))),
            5..=8 => (0..blocks).for_each(|b| interleave_eights(rows, m, m, 0, 8 * b, to(b))),
            _ => {
                for phase in (0..m).step_by(8) {
                    let first = phase.min(m - 8);
                    (0..blocks).for_each(|b| interleave_eights(rows, m, 8, first, 8 * b, to(b)));
                }
            }
        }
    }
    8 * blocks
}

#[inline(always)]
unsafe fn interleave_pairs(rows: Rows, done: usize, to: *mut f32) {
    unsafe {
        let (a, b) = (_mm256_loadu_ps(rows.at(0, done)), _mm256_loadu_ps(rows.at(1, done)));
        let (low, high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        _mm256_storeu_ps(to, _mm256_permute2f128_ps::<0x20>(low, high));
        _mm256_storeu_ps(to.add(8), _mm256_permute2f128_ps::<0x31>(low, high));
    }
}

#[inline(always)]
unsafe fn interleave_fours(rows: Rows, m: usize, done: usize, to: *mut f32) {
    unsafe {
        let mut block = [_mm256_setzero_ps(); 4];
        for (p, row) in block.iter_mut().enumerate().take(m) {
            *row = _mm256_loadu_ps(rows.at(p, done));
        }
        let frames = transpose4(block);
        if m == 4 {
            // Two frames a store.
            for half in 0..2 {
                let (a, b) = (frames[2 * half], frames[2 * half + 1]);
                _mm256_storeu_ps(to.add(8 * half), _mm256_permute2f128_ps::<0x20>(a, b));
                _mm256_storeu_ps(to.add(16 + 8 * half), _mm256_permute2f128_ps::<0x31>(a, b));
            }
            return;
        }
        for (f, frame) in frames.into_iter().enumerate() {
            _mm_storeu_ps(to.add(f * m), _mm256_castps256_ps128(frame));
        }
        for (f, frame) in frames.into_iter().enumerate() {
            _mm_storeu_ps(to.add((f + 4) * m), _mm256_extractf128_ps::<1>(frame));
        }
    }
}

#[inline(always)]
unsafe fn interleave_eights(rows: Rows, m: usize, count: usize, first: usize, done: usize, to: *mut f32) {
    unsafe {
        let mut block = [_mm256_setzero_ps(); 8];
        for (p, row) in block.iter_mut().enumerate().take(count) {
            *row = _mm256_loadu_ps(rows.at(first + p, done));
        }
        for (f, frame) in transpose8(block).into_iter().enumerate() {
            _mm256_storeu_ps(to.add(f * m + first), frame);
        }
    }
}

/// Four columns of two 4 x 4 blocks, one in each half.
#[inline(always)]
pub(super) unsafe fn transpose4([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    unsafe {
        let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0x44>(ab_low, cd_low),
            _mm256_shuffle_ps::<0xEE>(ab_low, cd_low),
            _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
            _mm256_shuffle_ps::<0xEE>(ab_high, cd_high),
        ]
    }
}

/// Eight columns of an 8 x 8 block.
#[inline(always)]
unsafe fn transpose8(rows: [__m256; 8]) -> [__m256; 8] {
    unsafe {
        let [a, b, c, d, e, f, g, h] = rows;
        let top = transpose4([a, b, c, d]);
        let bottom = transpose4([e, f, g, h]);
        let mut columns = [_mm256_setzero_ps(); 8];
        for i in 0..4 {
            columns[i] = _mm256_permute2f128_ps::<0x20>(top[i], bottom[i]);
            columns[i + 4] = _mm256_permute2f128_ps::<0x31>(top[i], bottom[i]);
        }
        columns
    }
}

/// Encodes as s16le; returns the samples done (a multiple of 16) and how many were clipped.
///
/// # Safety
/// AVX2; `out` has room.
#[inline(always)]
pub(super) unsafe fn encode_s16(samples: &[f32], out: &mut [u8]) -> (usize, u64) {
    let whole = samples.len().min(out.len() / 2) & !15;
    let mut clipped = 0;
    for (samples, out) in samples[..whole].chunks(COUNTED).zip(out.chunks_mut(2 * COUNTED)) {
        // SAFETY: the caller's.
        clipped += unsafe { encode_counted(samples, out.as_mut_ptr()) };
    }
    (whole, clipped)
}

/// Samples whose clipped ones are counted in the lanes of a vector, far fewer than fit.
const COUNTED: usize = 1 << 20;

/// A multiple of 16 samples; returns how many were clipped: those that do not round to an i16. -32768.5 rounds to -32768, which
/// fits, 32767.5 to 32768, which does not. NaN becomes 0.
#[inline(always)]
unsafe fn encode_counted(samples: &[f32], out: *mut u8) -> u64 {
    // SAFETY: the caller's.
    unsafe {
        let (scale, most) = (_mm256_set1_ps(32768.0), _mm256_set1_ps(32767.0));
        let (lowest, highest) = (_mm256_set1_ps(-32768.5), _mm256_set1_ps(32767.5));
        let mut clipped = _mm256_setzero_si256();
        for done in (0..samples.len()).step_by(16) {
            let mut wide = [_mm256_setzero_si256(); 2];
            for (half, wide) in wide.iter_mut().enumerate() {
                let scaled = _mm256_mul_ps(_mm256_loadu_ps(samples.as_ptr().add(done + 8 * half)), scale);
                let low = _mm256_cmp_ps::<_CMP_LT_OQ>(scaled, lowest);
                let high = _mm256_cmp_ps::<_CMP_GE_OQ>(scaled, highest);
                clipped = _mm256_sub_epi32(clipped, _mm256_castps_si256(_mm256_or_ps(low, high)));
                let number = _mm256_and_ps(scaled, _mm256_cmp_ps::<_CMP_ORD_Q>(scaled, scaled));
                // What is too small becomes the least i32, and what is too large would; packing saturates.
                *wide = _mm256_cvtps_epi32(_mm256_min_ps(most, number));
            }
            let packed = _mm256_packs_epi32(wide[0], wide[1]);
            let ordered = _mm256_permute4x64_epi64::<0b11_01_10_00>(packed);
            _mm256_storeu_si256(out.add(2 * done).cast(), ordered);
        }
        let mut lanes = [0u32; 8];
        _mm256_storeu_si256(lanes.as_mut_ptr().cast(), clipped);
        lanes.into_iter().map(u64::from).sum()
    }
}
