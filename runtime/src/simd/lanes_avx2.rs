//! [`Lanes`] in the registers of AVX2.

use super::lanes::{Group, Lanes};
use super::ticks_x86::{store_halves_f32, store_halves_f64, store_ticks_f32, store_ticks_f64};
use std::arch::x86_64::*;

/// Hides where a value comes from, or else the compiler makes horizontal adds of two shuffles and an
/// add, which processors split into four slow operations.
macro_rules! opaque {
    ($value:expr) => {{
        let mut value = $value;
        std::arch::asm!("/* {0} */", inout(ymm_reg) value, options(pure, nomem, nostack, preserves_flags));
        value
    }};
}

/// For each pair of lanes: a0 + a1, b0 + b1, a2 + a3, b2 + b3 ...
#[target_feature(enable = "avx2,fma")]
#[inline]
fn neighbours_f32(a: __m256, b: __m256) -> __m256 {
    // SAFETY: an empty instruction.
    let mixed = unsafe { opaque!(_mm256_blend_ps::<0b1010_1010>(b, a)) };
    _mm256_add_ps(_mm256_blend_ps::<0b1010_1010>(a, b), _mm256_permute_ps::<0b10_11_00_01>(mixed))
}

/// As [`neighbours_f32`].
#[target_feature(enable = "avx2,fma")]
#[inline]
fn neighbours_f64(a: __m256d, b: __m256d) -> __m256d {
    // SAFETY: an empty instruction.
    let mixed = unsafe { opaque!(_mm256_blend_pd::<0b1010>(b, a)) };
    _mm256_add_pd(_mm256_blend_pd::<0b1010>(a, b), _mm256_permute_pd::<0b0101>(mixed))
}

/// Lanes two apart: a02 a13 c20 c31 for each four.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn far_f32(a: __m256, c: __m256) -> __m256 {
    _mm256_add_ps(_mm256_blend_ps::<0b1100_1100>(a, c), _mm256_shuffle_ps::<0b01_00_11_10>(a, c))
}

/// Lanes two apart: a02 a13 c20 c31.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn far_f64(a: __m256d, c: __m256d) -> __m256d {
    _mm256_add_pd(_mm256_blend_pd::<0b1100>(a, c), _mm256_permute2f128_pd::<0x21>(a, c))
}

/// Both lower halves, both upper halves.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn halves_f32(a: __m256, b: __m256) -> [__m256; 2] {
    [_mm256_permute2f128_ps::<0x20>(a, b), _mm256_permute2f128_ps::<0x31>(a, b)]
}

/// For each four lanes: the sum of those of a, of b, of c, of d.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn quads_f32([a, b, c, d]: [__m256; 4]) -> __m256 {
    neighbours_f32(far_f32(a, c), far_f32(b, d))
}

impl Group for __m256 {
    type Sample = f32;

    #[inline(always)]
    unsafe fn diagonal_pairs(a: Self, b: Self) -> Self {
        unsafe { _mm256_add_ps(a, _mm256_permute_ps::<0b10_11_00_01>(b)) }
    }

    #[inline(always)]
    unsafe fn diagonal_quads([a, b, c, d]: [Self; 4]) -> Self {
        unsafe {
            let two = |a, c| _mm256_add_ps(a, _mm256_permute_ps::<0b01_00_11_10>(c));
            _mm256_add_ps(two(a, c), _mm256_permute_ps::<0b10_01_00_11>(two(b, d)))
        }
    }

    #[inline(always)]
    unsafe fn diagonal_halves([a, b, c, d]: [Self; 4]) -> Self {
        unsafe { Self::diagonal_pairs(far_f32(a, c), far_f32(b, d)) }
    }

    #[inline(always)]
    unsafe fn store_ticks<const P: usize, const D: usize>(sums: [Self; 4], out: *mut f32, hop: usize) {
        unsafe { store_ticks_f32::<P, D>(sums, out, hop) }
    }

    #[inline(always)]
    unsafe fn store_halves(sums: [Self; 4], out: [*mut f32; 2], hop: usize) {
        unsafe { store_halves_f32(sums, out, hop) }
    }

    #[inline(always)]
    unsafe fn ticks<const D: usize>(lanes: impl Fn(usize) -> Self) -> Self {
        unsafe {
            match D {
                1 => lanes(0),
                2 => {
                    // Ticks 0 4 1 5 2 6 3 7.
                    let mixed = neighbours_f32(lanes(0), lanes(1));
                    _mm256_permutevar8x32_ps(mixed, _mm256_setr_epi32(0, 2, 4, 6, 1, 3, 5, 7))
                }
                4 => {
                    // Ticks 0 2 4 6 1 3 5 7.
                    let mixed = quads_f32([lanes(0), lanes(1), lanes(2), lanes(3)]);
                    _mm256_permutevar8x32_ps(mixed, _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7))
                }
                _ => {
                    let first = quads_f32([lanes(0), lanes(1), lanes(2), lanes(3)]);
                    let second = quads_f32([lanes(4), lanes(5), lanes(6), lanes(7)]);
                    let [low, high] = halves_f32(first, second);
                    _mm256_add_ps(low, high)
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn load(at: *const f32) -> Self {
        unsafe { _mm256_loadu_ps(at) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // An instruction that is none: or else the compiler adds always and chooses afterwards, which costs more than
        // the branch around it.
        unsafe {
            std::arch::asm!("", options(nomem, nostack, preserves_flags));
            _mm256_add_ps(self, other)
        }
    }

    #[inline(always)]
    unsafe fn finite(self) -> bool {
        // What is not finite is not 0 after that.
        unsafe {
            let zero = _mm256_sub_ps(self, self);
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_NEQ_UQ>(zero, _mm256_setzero_ps())) == 0
        }
    }

    #[inline(always)]
    unsafe fn store(self, at: *mut f32) {
        unsafe { _mm256_storeu_ps(at, self) }
    }
}

/// For each four lanes: the sum of those of a, of b, of c, of d.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn quads_f64([a, b, c, d]: [__m256d; 4]) -> __m256d {
    neighbours_f64(far_f64(a, c), far_f64(b, d))
}

impl Group for __m256d {
    type Sample = f64;

    #[inline(always)]
    unsafe fn diagonal_pairs(a: Self, b: Self) -> Self {
        unsafe { _mm256_add_pd(a, _mm256_permute_pd::<0b0101>(b)) }
    }

    #[inline(always)]
    unsafe fn diagonal_quads([a, b, c, d]: [Self; 4]) -> Self {
        unsafe {
            let two = |a, c| _mm256_add_pd(a, _mm256_permute4x64_pd::<0b01_00_11_10>(c));
            _mm256_add_pd(two(a, c), _mm256_permute4x64_pd::<0b10_01_00_11>(two(b, d)))
        }
    }

    #[inline(always)]
    unsafe fn diagonal_halves([a, b, c, d]: [Self; 4]) -> Self {
        unsafe { Self::diagonal_pairs(far_f64(a, c), far_f64(b, d)) }
    }

    #[inline(always)]
    unsafe fn store_ticks<const P: usize, const D: usize>(sums: [Self; 4], out: *mut f64, hop: usize) {
        unsafe { store_ticks_f64::<P, D>(sums, out, hop) }
    }

    #[inline(always)]
    unsafe fn store_halves(sums: [Self; 4], out: [*mut f64; 2], _: usize) {
        unsafe { store_halves_f64(sums, out) }
    }

    #[inline(always)]
    unsafe fn ticks<const D: usize>(lanes: impl Fn(usize) -> Self) -> Self {
        unsafe {
            match D {
                1 => lanes(0),
                // Ticks 0 2 1 3.
                2 => _mm256_permute4x64_pd::<0b11_01_10_00>(neighbours_f64(lanes(0), lanes(1))),
                _ => quads_f64([lanes(0), lanes(1), lanes(2), lanes(3)]),
            }
        }
    }

    #[inline(always)]
    unsafe fn load(at: *const f64) -> Self {
        unsafe { _mm256_loadu_pd(at) }
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // An instruction that is none: or else the compiler adds always and chooses afterwards, which costs more than
        // the branch around it.
        unsafe {
            std::arch::asm!("", options(nomem, nostack, preserves_flags));
            _mm256_add_pd(self, other)
        }
    }

    #[inline(always)]
    unsafe fn finite(self) -> bool {
        // What is not finite is not 0 after that.
        unsafe {
            let zero = _mm256_sub_pd(self, self);
            _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_NEQ_UQ>(zero, _mm256_setzero_pd())) == 0
        }
    }

    #[inline(always)]
    unsafe fn store(self, at: *mut f64) {
        unsafe { _mm256_storeu_pd(at, self) }
    }
}

/// One step of a tile of 4 x 3: the one `$s` steps behind that at the pointers.
macro_rules! full_step {
    ($s:literal, $load:literal, $spread:literal, $fma:literal, $bytes:literal) => {
        concat!(
            full_step!(@input $load, "x0", "", $s, $bytes),
            full_step!(@input $load, "x1", " + {stride}", $s, $bytes),
            full_step!(@input $load, "x2", " + 2*{stride}", $s, $bytes),
            full_step!(@phase $spread, $fma, "a", "0", $s, $bytes),
            full_step!(@phase $spread, $fma, "b", "1", $s, $bytes),
            full_step!(@phase $spread, $fma, "c", "2", $s, $bytes),
            full_step!(@phase $spread, $fma, "d", "3", $s, $bytes),
        )
    };
    (@input $load:literal, $to:literal, $vector:literal, $s:literal, $bytes:literal) => {
        concat!($load, " {", $to, "}, [{x}", $vector, " - ", $s, "*", $bytes, "]\n")
    };
    (@phase $spread:literal, $fma:literal, $sums:literal, $p:literal, $s:literal, $bytes:literal) => {
        concat!(
            $spread, " {k}, [{w} + (4*", $s, "+", $p, ")*", $bytes, "]\n",
            $fma, " {", $sums, "0}, {x0}, {k}\n",
            $fma, " {", $sums, "1}, {x1}, {k}\n",
            $fma, " {", $sums, "2}, {x2}, {k}\n",
        )
    };
    (@next $steps:literal, $bytes:literal) => {
        concat!("sub {x}, ", $steps, "*", $bytes, "\nadd {w}, 4*", $steps, "*", $bytes, "\n")
    };
}

/// The loop of [`Lanes::full_tile`] for AVX2, two steps a turn. Twelve sums, three inputs and a
/// coefficient are exactly its sixteen registers; the compiler's own order of instructions spills some.
macro_rules! full_tile {
    ($x:ident, $stride:ident, $w:ident, $steps:ident, $zero:expr, $size:literal, ($load:literal, $spread:literal, $fma:literal, $bytes:literal)) => {{
        let [mut a, mut b, mut c, mut d] = [[$zero; 3]; 4];
        std::arch::asm!(
            "test {steps}, 1",
            "jz 3f",
            full_step!("0", $load, $spread, $fma, $bytes),
            full_step!(@next "1", $bytes),
            "3:",
            "shr {steps}",
            "jz 4f",
            ".p2align 6",
            "2:",
            full_step!("0", $load, $spread, $fma, $bytes),
            full_step!("1", $load, $spread, $fma, $bytes),
            full_step!(@next "2", $bytes),
            "dec {steps}",
            "jnz 2b",
            "4:",
            x = inout(reg) $x => _,
            w = inout(reg) $w => _,
            steps = inout(reg) $steps => _,
            stride = in(reg) $stride * $size,
            x0 = out(ymm_reg) _, x1 = out(ymm_reg) _, x2 = out(ymm_reg) _, k = out(ymm_reg) _,
            a0 = inout(ymm_reg) a[0], a1 = inout(ymm_reg) a[1], a2 = inout(ymm_reg) a[2],
            b0 = inout(ymm_reg) b[0], b1 = inout(ymm_reg) b[1], b2 = inout(ymm_reg) b[2],
            c0 = inout(ymm_reg) c[0], c1 = inout(ymm_reg) c[1], c2 = inout(ymm_reg) c[2],
            d0 = inout(ymm_reg) d[0], d1 = inout(ymm_reg) d[1], d2 = inout(ymm_reg) d[2],
            options(nostack, readonly),
        );
        [a, b, c, d]
    }};
}

/// # Safety
/// As for [`Lanes::full_tile`].
#[target_feature(enable = "avx2,fma")]
#[inline]
unsafe fn full_tile_f32<const D: usize>(
    x: *const f32,
    stride: usize,
    w: *const f32,
    steps: usize,
) -> [[__m256; 3]; 4] {
    let zero = _mm256_setzero_ps();
    // SAFETY: reads what the caller vouches for, writes registers only, ends after `steps` turns.
    unsafe {
        match D {
            1 => full_tile!(x, stride, w, steps, zero, 4, ("vmovups", "vbroadcastss", "vfmadd231ps", "4")),
            2 => full_tile!(x, stride, w, steps, zero, 4, ("vmovups", "vbroadcastsd", "vfmadd231ps", "8")),
            4 => full_tile!(x, stride, w, steps, zero, 4, ("vmovups", "vbroadcastf128", "vfmadd231ps", "16")),
            _ => full_tile!(x, stride, w, steps, zero, 4, ("vmovups", "vmovups", "vfmadd231ps", "32")),
        }
    }
}

/// # Safety
/// As for [`Lanes::full_tile`].
#[target_feature(enable = "avx2,fma")]
#[inline]
unsafe fn full_tile_f64<const D: usize>(
    x: *const f64,
    stride: usize,
    w: *const f64,
    steps: usize,
) -> [[__m256d; 3]; 4] {
    let zero = _mm256_setzero_pd();
    // SAFETY: as above.
    unsafe {
        match D {
            1 => full_tile!(x, stride, w, steps, zero, 8, ("vmovupd", "vbroadcastsd", "vfmadd231pd", "8")),
            2 => full_tile!(x, stride, w, steps, zero, 8, ("vmovupd", "vbroadcastf128", "vfmadd231pd", "16")),
            _ => full_tile!(x, stride, w, steps, zero, 8, ("vmovupd", "vmovupd", "vfmadd231pd", "32")),
        }
    }
}

impl Lanes for __m256 {
    type Sample = f32;
    type Group = Self;
    const GROUP: usize = 8;
    const GROUPS: usize = 1;
    const SUMS: usize = 12;

    #[inline(always)]
    unsafe fn zero() -> Self {
        unsafe { _mm256_setzero_ps() }
    }

    #[inline(always)]
    unsafe fn spread<const D: usize>(at: *const f32) -> Self {
        unsafe {
            match D {
                1 => _mm256_set1_ps(*at),
                2 => _mm256_castpd_ps(_mm256_set1_pd(at.cast::<f64>().read_unaligned())),
                4 => {
                    let quad = _mm_loadu_ps(at);
                    _mm256_set_m128(quad, quad)
                }
                _ => _mm256_loadu_ps(at),
            }
        }
    }

    #[inline(always)]
    unsafe fn windows<const D: usize>(at: *const f32, _: usize) -> Self {
        unsafe { _mm256_loadu_ps(at) }
    }

    #[inline(always)]
    unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
        unsafe { _mm256_fmadd_ps(self, factor, sum) }
    }

    #[inline(always)]
    unsafe fn group(self, _: usize) -> Self {
        self
    }

    #[inline(always)]
    unsafe fn full_tile<const D: usize>(
        x: *const f32,
        stride: usize,
        coefficients: *const f32,
        steps: usize,
    ) -> Option<[[Self; 3]; 4]> {
        Some(unsafe { full_tile_f32::<D>(x, stride, coefficients, steps) })
    }
}

impl Lanes for __m256d {
    type Sample = f64;
    type Group = Self;
    const GROUP: usize = 4;
    const GROUPS: usize = 1;
    const SUMS: usize = 12;

    #[inline(always)]
    unsafe fn zero() -> Self {
        unsafe { _mm256_setzero_pd() }
    }

    #[inline(always)]
    unsafe fn spread<const D: usize>(at: *const f64) -> Self {
        unsafe {
            match D {
                1 => _mm256_set1_pd(*at),
                2 => {
                    let pair = _mm_loadu_pd(at);
                    _mm256_set_m128d(pair, pair)
                }
                _ => _mm256_loadu_pd(at),
            }
        }
    }

    #[inline(always)]
    unsafe fn windows<const D: usize>(at: *const f64, _: usize) -> Self {
        unsafe { _mm256_loadu_pd(at) }
    }

    #[inline(always)]
    unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
        unsafe { _mm256_fmadd_pd(self, factor, sum) }
    }

    #[inline(always)]
    unsafe fn group(self, _: usize) -> Self {
        self
    }

    #[inline(always)]
    unsafe fn full_tile<const D: usize>(
        x: *const f64,
        stride: usize,
        coefficients: *const f64,
        steps: usize,
    ) -> Option<[[Self; 3]; 4]> {
        Some(unsafe { full_tile_f64::<D>(x, stride, coefficients, steps) })
    }
}
