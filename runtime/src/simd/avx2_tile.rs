//! The loop of the tile that fills the registers of AVX2, in assembly.
//!
//! 4 phases times 3 vectors are twelve sums; with three inputs and a coefficient they are exactly its
//! sixteen registers. The compiler's own order of instructions spills some.

use std::arch::x86_64::*;

/// One step of the tile, the one `$s` steps after that at the pointers.
macro_rules! step {
    ($s:literal, $load:literal, $broadcast:literal, $fma:literal, $bytes:literal) => {
        concat!(
            step!(@input $load, "x0", "", $s, $bytes),
            step!(@input $load, "x1", " + {stride}", $s, $bytes),
            step!(@input $load, "x2", " + 2*{stride}", $s, $bytes),
            step!(@phase $broadcast, $fma, "a", "0", $s, $bytes),
            step!(@phase $broadcast, $fma, "b", "1", $s, $bytes),
            step!(@phase $broadcast, $fma, "c", "2", $s, $bytes),
            step!(@phase $broadcast, $fma, "d", "3", $s, $bytes),
        )
    };
    (@input $load:literal, $to:literal, $vector:literal, $s:literal, $bytes:literal) => {
        concat!($load, " {", $to, "}, [{x}", $vector, " - ", $s, "*", $bytes, "]\n")
    };
    (@phase $broadcast:literal, $fma:literal, $sums:literal, $p:literal, $s:literal, $bytes:literal) => {
        concat!(
            $broadcast, " {k}, [{w} + (4*", $s, "+", $p, ")*", $bytes, "]\n",
            $fma, " {", $sums, "0}, {x0}, {k}\n",
            $fma, " {", $sums, "1}, {x1}, {k}\n",
            $fma, " {", $sums, "2}, {x2}, {k}\n",
        )
    };
    (@next $steps:literal, $bytes:literal) => {
        concat!("sub {x}, ", $steps, "*", $bytes, "\nadd {w}, 4*", $steps, "*", $bytes, "\n")
    };
}

/// All steps, two an iteration.
macro_rules! tile {
    ($x:ident, $stride:ident, $w:ident, $steps:ident, $zero:expr, $size:literal, ($load:literal, $broadcast:literal, $fma:literal, $bytes:literal)) => {{
        let [mut a, mut b, mut c, mut d] = [[$zero; 3]; 4];
        // SAFETY: reads what the caller vouches for, writes registers only, ends after `steps` steps.
        unsafe {
            std::arch::asm!(
                "test {steps}, 1",
                "jz 3f",
                step!("0", $load, $broadcast, $fma, $bytes),
                step!(@next "1", $bytes),
                "3:",
                "shr {steps}",
                "jz 4f",
                ".p2align 6",
                "2:",
                step!("0", $load, $broadcast, $fma, $bytes),
                step!("1", $load, $broadcast, $fma, $bytes),
                step!(@next "2", $bytes),
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
        }
        [a, b, c, d]
    }};
}

/// Sums of 4 phases times 3 vectors as P times R, if these are 4 and 3.
macro_rules! sized {
    ($sums:ident, $wrap:ident) => {
        Some(std::array::from_fn(|p| std::array::from_fn(|r| $wrap($sums[p][r]))))
    };
}

/// [`Vector::tile`](super::vector::Vector::tile), with registers made vectors.
///
/// # Safety
/// As there.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn tile_f32<V, const D: usize, const P: usize, const R: usize>(
    wrap: impl Fn(__m256) -> V,
    x: *const f32,
    stride: usize,
    w: *const f32,
    steps: usize,
) -> Option<[[V; R]; P]> {
    if const { cfg!(miri) || P != 4 || R != 3 } {
        return None;
    }
    let zero = _mm256_setzero_ps();
    let sums = match D {
        1 => tile!(x, stride, w, steps, zero, 4, ("vmovups", "vbroadcastss", "vfmadd231ps", "4")),
        2 => tile!(x, stride, w, steps, zero, 4, ("vmovups", "vbroadcastsd", "vfmadd231ps", "8")),
        4 => tile!(x, stride, w, steps, zero, 4, ("vmovups", "vbroadcastf128", "vfmadd231ps", "16")),
        _ => tile!(x, stride, w, steps, zero, 4, ("vmovups", "vmovups", "vfmadd231ps", "32")),
    };
    sized!(sums, wrap)
}

/// [`Vector::tile`](super::vector::Vector::tile), with registers made vectors.
///
/// # Safety
/// As there.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn tile_f64<V, const D: usize, const P: usize, const R: usize>(
    wrap: impl Fn(__m256d) -> V,
    x: *const f64,
    stride: usize,
    w: *const f64,
    steps: usize,
) -> Option<[[V; R]; P]> {
    if const { cfg!(miri) || P != 4 || R != 3 } {
        return None;
    }
    let zero = _mm256_setzero_pd();
    let sums = match D {
        1 => tile!(x, stride, w, steps, zero, 8, ("vmovupd", "vbroadcastsd", "vfmadd231pd", "8")),
        2 => tile!(x, stride, w, steps, zero, 8, ("vmovupd", "vbroadcastf128", "vfmadd231pd", "16")),
        _ => tile!(x, stride, w, steps, zero, 8, ("vmovupd", "vmovupd", "vfmadd231pd", "32")),
    };
    sized!(sums, wrap)
}
