//! Samples as they lie in memory to planar f32 rows and back, with AVX2.
//!
//! Frames of N samples become N rows by transposing 8 x 8 (or 4 x 4, or 2 x 8) blocks in registers;
//! integers are converted in the load. For N that is no power of two a block reads past its
//! frame into the next ones, and rows that mean nothing are not stored; on the way out a block
//! writes past its frame, and the next frame overwrites what means nothing. The last frames,
//! where that would leave the slice, are left to the caller.

use std::arch::x86_64::*;

/// Samples of a format, eight or four at a time.
pub(super) trait Load: Copy {
    /// Bytes a sample.
    const BYTES: usize;
    unsafe fn load8(at: *const u8) -> __m256;
    unsafe fn load4(at: *const u8) -> __m128;
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

    #[inline(always)]
    unsafe fn load4(at: *const u8) -> __m128 {
        unsafe { _mm_loadu_ps(at.cast()) }
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

    #[inline(always)]
    unsafe fn load4(at: *const u8) -> __m128 {
        unsafe {
            let wide = _mm_cvtepi16_epi32(_mm_loadl_epi64(at.cast()));
            _mm_mul_ps(_mm_cvtepi32_ps(wide), _mm_set1_ps(1.0 / 32768.0))
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

    #[inline(always)]
    unsafe fn load4(at: *const u8) -> __m128 {
        unsafe {
            let wide = _mm_loadu_si128(at.cast());
            _mm_mul_ps(_mm_cvtepi32_ps(wide), _mm_set1_ps(1.0 / 2147483648.0))
        }
    }
}

/// Where rows lie: `stride` samples apart.
#[derive(Clone, Copy)]
pub(super) struct Rows {
    pub(super) first: *mut f32,
    pub(super) stride: usize,
}

impl Rows {
    #[inline(always)]
    unsafe fn at(self, row: usize, frame: usize) -> *mut f32 {
        unsafe { self.first.add(row * self.stride + frame) }
    }
}

/// Notes which of the values were NaN or infinite.
#[derive(Clone, Copy)]
struct Watch(__m256i);

impl Watch {
    #[inline(always)]
    unsafe fn see(&mut self, values: __m256) {
        unsafe {
            let exponent = _mm256_set1_epi32(0x7F80_0000);
            let bits = _mm256_and_si256(_mm256_castps_si256(values), exponent);
            self.0 = _mm256_or_si256(self.0, _mm256_cmpeq_epi32(bits, exponent));
        }
    }
}

/// Rows from interleaved frames of `n` samples; returns the frames done (the last few may be
/// left) and whether there may be a value among them that is not finite.
///
/// # Safety
/// AVX2; `bytes` holds `frames` frames; each of the n rows has room for `frames` samples rounded up to 8.
#[inline(always)]
pub(super) unsafe fn deinterleave<L: Load>(
    bytes: &[u8],
    n: usize,
    frames: usize,
    rows: Rows,
) -> (usize, bool) {
    let frame_bytes = n * L::BYTES;
    // Bytes that a block reads from the start of its last frame on.
    let reach = reach(n) * L::BYTES;
    let blocks = blocks(frames, bytes.len(), frame_bytes, reach);
    // SAFETY: block b reads from `8 b frame_bytes` on and no further than `bytes`, see `blocks`.
    unsafe {
        let mut watch = Watch(_mm256_setzero_si256());
        let from = |b: usize| bytes.as_ptr().add(8 * b * frame_bytes);
        match n {
            1 => {
                for b in 0..blocks {
                    let a = L::load8(from(b));
                    watch.see(a);
                    _mm256_storeu_ps(rows.at(0, 8 * b), a);
                }
            }
            2 => (0..blocks).for_each(|b| pairs::<L>(from(b), 8 * b, rows, &mut watch)),
            3 | 4 => (0..blocks).for_each(|b| fours::<L>(from(b), n, 8 * b, rows, &mut watch)),
            _ => {
                for channel in (0..n).step_by(8) {
                    let first = channel.min(n.max(8) - 8);
                    let count = n.min(8);
                    for b in 0..blocks {
                        eights::<L>(from(b), frame_bytes, count, first, 8 * b, rows, &mut watch);
                    }
                }
            }
        }
        (8 * blocks, _mm256_movemask_epi8(watch.0) != 0)
    }
}

/// Samples that the last frame of a block is read or written as.
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

#[inline(always)]
unsafe fn pairs<L: Load>(from: *const u8, done: usize, rows: Rows, watch: &mut Watch) {
    unsafe {
        let (v, w) = (L::load8(from), L::load8(from.add(8 * L::BYTES)));
        watch.see(v);
        watch.see(w);
        // a0 a1 a4 a5 a2 a3 a6 a7, then the middle pairs change places.
        let a = _mm256_castps_pd(_mm256_shuffle_ps::<0x88>(v, w));
        let b = _mm256_castps_pd(_mm256_shuffle_ps::<0xDD>(v, w));
        _mm256_storeu_ps(rows.at(0, done), _mm256_castpd_ps(_mm256_permute4x64_pd::<0xD8>(a)));
        _mm256_storeu_ps(rows.at(1, done), _mm256_castpd_ps(_mm256_permute4x64_pd::<0xD8>(b)));
    }
}

#[inline(always)]
unsafe fn fours<L: Load>(from: *const u8, n: usize, done: usize, rows: Rows, watch: &mut Watch) {
    unsafe {
        let step = n * L::BYTES;
        let load = |f: usize| {
            _mm256_insertf128_ps::<1>(
                _mm256_castps128_ps256(L::load4(from.add(f * step))),
                L::load4(from.add((f + 4) * step)),
            )
        };
        let columns = transpose4([load(0), load(1), load(2), load(3)]);
        for (i, column) in columns.into_iter().enumerate().take(n) {
            watch.see(column);
            _mm256_storeu_ps(rows.at(i, done), column);
        }
    }
}

#[inline(always)]
unsafe fn eights<L: Load>(
    from: *const u8,
    frame_bytes: usize,
    count: usize,
    first: usize,
    done: usize,
    rows: Rows,
    watch: &mut Watch,
) {
    unsafe {
        let from = from.add(first * L::BYTES);
        let mut block = [_mm256_setzero_ps(); 8];
        for (f, row) in block.iter_mut().enumerate() {
            *row = L::load8(from.add(f * frame_bytes));
        }
        for (i, column) in transpose8(block).into_iter().enumerate().take(count) {
            watch.see(column);
            _mm256_storeu_ps(rows.at(first + i, done), column);
        }
    }
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
unsafe fn transpose4([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
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

/// Encodes as s16le; returns the samples done (a multiple of 8) and how many were clipped.
///
/// # Safety
/// AVX2; `out` has room.
#[inline(always)]
pub(super) unsafe fn encode_s16(samples: &[f32], out: &mut [u8]) -> (usize, u64) {
    let mut done = 0;
    let mut clipped = 0;
    unsafe {
        let (low, high) = (_mm256_set1_ps(-32768.0), _mm256_set1_ps(32767.0));
        while done + 8 <= samples.len() && 2 * (done + 8) <= out.len() {
            let scaled = _mm256_mul_ps(_mm256_loadu_ps(samples.as_ptr().add(done)), _mm256_set1_ps(32768.0));
            let rounded = _mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(scaled);
            let held = _mm256_max_ps(low, _mm256_min_ps(high, rounded));
            let outside = _mm256_cmp_ps::<_CMP_NEQ_OQ>(held, rounded);
            clipped += u64::from((_mm256_movemask_ps(outside) as u32).count_ones());
            let wide = _mm256_cvtps_epi32(held);
            let packed = _mm_packs_epi32(_mm256_castsi256_si128(wide), _mm256_extracti128_si256::<1>(wide));
            _mm_storeu_si128(out.as_mut_ptr().add(2 * done).cast(), packed);
            done += 8;
        }
    }
    (done, clipped)
}
