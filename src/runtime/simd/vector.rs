//! Vectors of one sample type, alike for all instruction sets.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

/// A register of samples.
///
/// # Safety
/// The methods of a type may only run on a processor that has its instruction set, and inside a
/// function compiled for it (or else they are calls instead of instructions). `load` and `store`
/// touch `LANES` samples from `at`.
pub(super) trait Vector: Copy {
    type Sample: Copy;
    const LANES: usize;
    /// Vectors of accumulators for P phases such that accumulators, inputs and one coefficient
    /// fit the register file.
    const REGISTERS: usize;
    unsafe fn splat(value: Self::Sample) -> Self;
    /// All zeros.
    #[inline(always)]
    unsafe fn zero() -> Self
    where
        Self::Sample: Default,
    {
        // SAFETY: the caller's.
        unsafe { Self::splat(Self::Sample::default()) }
    }
    unsafe fn load(at: *const Self::Sample) -> Self;
    unsafe fn store(self, at: *mut Self::Sample);
    /// self * factor + sum, rounded once.
    unsafe fn mul_add(self, factor: Self, sum: Self) -> Self;
    /// A tile of 4 phases times 3 vectors, for sets whose registers it fills to the last one: sums of
    /// `steps` >= 1 products of x[offsets[s] ..] and coefficients[4 s ..], stored in rows `stride`
    /// apart. False leaves it to the compiler.
    #[inline(always)]
    unsafe fn full_tile(
        _x: *const Self::Sample,
        _offsets: *const u32,
        _coefficients: *const Self::Sample,
        _steps: usize,
        _out: *mut Self::Sample,
        _stride: usize,
    ) -> bool {
        false
    }
}

/// The loop of [`Vector::full_tile`] for AVX2. Twelve sums, three inputs and a coefficient are
/// exactly its sixteen registers; the compiler's own order of instructions spills some of them.
#[cfg(target_arch = "x86_64")]
macro_rules! full_tile {
    (outer) => {
        #[inline(always)]
        unsafe fn full_tile(
            x: *const Self::Sample,
            offsets: *const u32,
            coefficients: *const Self::Sample,
            steps: usize,
            out: *mut Self::Sample,
            stride: usize,
        ) -> bool {
            // SAFETY: the caller's.
            unsafe { Self::sixteen_registers(x, offsets, coefficients, steps, out, stride) };
            true
        }
    };
    (inner $sample:ty, $zero:ident, $store:ident, $load:literal, $splat:literal, $fma:literal, $size:literal) => {
        #[target_feature(enable = "avx2,fma")]
        unsafe fn sixteen_registers(
            x: *const $sample,
            offsets: *const u32,
            coefficients: *const $sample,
            steps: usize,
            out: *mut $sample,
            stride: usize,
        ) {
            let zero = $zero();
            let [mut a, mut b, mut c, mut d] = [[zero; 3]; 4];
            // SAFETY: reads what the caller vouches for, writes registers only, ends after `steps` turns.
            unsafe {
                std::arch::asm!(
                    "2:",
                    "mov {at:e}, dword ptr [{offsets}]",
                    concat!($load, " {x0}, [{x} + ", $size, "*{at}]"),
                    concat!($load, " {x1}, [{x} + ", $size, "*{at} + 32]"),
                    concat!($load, " {x2}, [{x} + ", $size, "*{at} + 64]"),
                    concat!($splat, " {w}, [{coefficients}]"),
                    concat!($fma, " {a0}, {x0}, {w}"),
                    concat!($fma, " {a1}, {x1}, {w}"),
                    concat!($fma, " {a2}, {x2}, {w}"),
                    concat!($splat, " {w}, [{coefficients} + ", $size, "]"),
                    concat!($fma, " {b0}, {x0}, {w}"),
                    concat!($fma, " {b1}, {x1}, {w}"),
                    concat!($fma, " {b2}, {x2}, {w}"),
                    concat!($splat, " {w}, [{coefficients} + 2*", $size, "]"),
                    concat!($fma, " {c0}, {x0}, {w}"),
                    concat!($fma, " {c1}, {x1}, {w}"),
                    concat!($fma, " {c2}, {x2}, {w}"),
                    concat!($splat, " {w}, [{coefficients} + 3*", $size, "]"),
                    concat!($fma, " {d0}, {x0}, {w}"),
                    concat!($fma, " {d1}, {x1}, {w}"),
                    concat!($fma, " {d2}, {x2}, {w}"),
                    "add {offsets}, 4",
                    concat!("add {coefficients}, 4*", $size),
                    "dec {steps}",
                    "jnz 2b",
                    at = out(reg) _,
                    x = in(reg) x,
                    offsets = inout(reg) offsets => _,
                    coefficients = inout(reg) coefficients => _,
                    steps = inout(reg) steps => _,
                    x0 = out(ymm_reg) _, x1 = out(ymm_reg) _, x2 = out(ymm_reg) _, w = out(ymm_reg) _,
                    a0 = inout(ymm_reg) a[0], a1 = inout(ymm_reg) a[1], a2 = inout(ymm_reg) a[2],
                    b0 = inout(ymm_reg) b[0], b1 = inout(ymm_reg) b[1], b2 = inout(ymm_reg) b[2],
                    c0 = inout(ymm_reg) c[0], c1 = inout(ymm_reg) c[1], c2 = inout(ymm_reg) c[2],
                    d0 = inout(ymm_reg) d[0], d1 = inout(ymm_reg) d[1], d2 = inout(ymm_reg) d[2],
                    options(nostack, readonly),
                );
            }
            for r in 0..3 {
                // SAFETY: the caller's.
                unsafe {
                    let out = out.add(r * Self::LANES);
                    $store(out, a[r]);
                    $store(out.add(stride), b[r]);
                    $store(out.add(2 * stride), c[r]);
                    $store(out.add(3 * stride), d[r]);
                }
            }
        }
    };
}

/// Squares of samples, as many rows as a vector has lanes.
///
/// # Safety
/// As for [`Vector`]; `transpose` reads and writes `LANES` samples of `LANES` rows.
pub(super) trait Transpose: Vector {
    /// `to[l * to_stride + k] = from[k * from_stride + l]`.
    unsafe fn transpose(
        from: *const Self::Sample,
        from_stride: usize,
        to: *mut Self::Sample,
        to_stride: usize,
    );
}

#[cfg(target_arch = "x86_64")]
impl Transpose for Avx2F64 {
    #[inline(always)]
    unsafe fn transpose(from: *const f64, from_stride: usize, to: *mut f64, to_stride: usize) {
        // SAFETY: the caller's.
        unsafe {
            // Halves of rows k and k + 2 side by side, then pairs by unpacking.
            let halves = |k: usize, half: usize| {
                let at = |k: usize| _mm_loadu_pd(from.add(k * from_stride + 2 * half));
                _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(at(k)), at(k + 2))
            };
            for half in 0..2 {
                let (even, odd) = (halves(0, half), halves(1, half));
                _mm256_storeu_pd(to.add(2 * half * to_stride), _mm256_unpacklo_pd(even, odd));
                _mm256_storeu_pd(to.add((2 * half + 1) * to_stride), _mm256_unpackhi_pd(even, odd));
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl Transpose for Avx2F32 {
    #[inline(always)]
    unsafe fn transpose(from: *const f32, from_stride: usize, to: *mut f32, to_stride: usize) {
        // SAFETY: the caller's.
        unsafe {
            // Halves of rows k and k + 4 side by side, then twice by unpacking.
            let halves = |k: usize, half: usize| {
                let at = |k: usize| _mm_loadu_ps(from.add(k * from_stride + 4 * half));
                _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(at(k)), at(k + 4))
            };
            for half in 0..2 {
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| halves(k, half));
                let [p, q] = [_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d)];
                let [r, s] = [_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d)];
                let row = |l: usize| to.add((4 * half + l) * to_stride);
                _mm256_storeu_ps(row(0), _mm256_shuffle_ps::<0b01_00_01_00>(p, q));
                _mm256_storeu_ps(row(1), _mm256_shuffle_ps::<0b11_10_11_10>(p, q));
                _mm256_storeu_ps(row(2), _mm256_shuffle_ps::<0b01_00_01_00>(r, s));
                _mm256_storeu_ps(row(3), _mm256_shuffle_ps::<0b11_10_11_10>(r, s));
            }
        }
    }
}

/// Arrays that the compiler turns into whatever vectors the architecture has.
#[derive(Clone, Copy)]
pub(super) struct Portable<T>([T; 4]);

/// True where `mul_add` is an instruction of every processor of the target.
const FUSED: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

macro_rules! portable {
    ($sample:ty) => {
        impl Transpose for Portable<$sample> {
            #[inline(always)]
            unsafe fn transpose(
                from: *const $sample,
                from_stride: usize,
                to: *mut $sample,
                to_stride: usize,
            ) {
                for l in 0..Self::LANES {
                    for k in 0..Self::LANES {
                        // SAFETY: the caller's.
                        unsafe { *to.add(l * to_stride + k) = *from.add(k * from_stride + l) }
                    }
                }
            }
        }

        impl Vector for Portable<$sample> {
            type Sample = $sample;
            const LANES: usize = 4;
            const REGISTERS: usize = 12;

            #[inline(always)]
            unsafe fn splat(value: $sample) -> Self {
                Self([value; 4])
            }

            #[inline(always)]
            unsafe fn load(at: *const $sample) -> Self {
                Self(unsafe { at.cast::<[$sample; 4]>().read_unaligned() })
            }

            #[inline(always)]
            unsafe fn store(self, at: *mut $sample) {
                unsafe { at.cast::<[$sample; 4]>().write_unaligned(self.0) }
            }

            #[inline(always)]
            unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
                Self(std::array::from_fn(|lane| {
                    let (a, b, c) = (self.0[lane], factor.0[lane], sum.0[lane]);
                    if FUSED { a.mul_add(b, c) } else { a * b + c }
                }))
            }
        }
    };
}

portable!(f32);
portable!(f64);

#[cfg(target_arch = "x86_64")]
macro_rules! x86 {
    ($name:ident, $register:ty, $sample:ty, $lanes:literal, $registers:literal, $splat:ident, $load:ident, $store:ident, $fma:ident $(, $full:tt)?) => {
        #[derive(Clone, Copy)]
        pub(super) struct $name($register);

        impl Vector for $name {
            type Sample = $sample;
            const LANES: usize = $lanes;
            const REGISTERS: usize = $registers;

            #[inline(always)]
            unsafe fn splat(value: $sample) -> Self {
                Self(unsafe { $splat(value) })
            }

            #[inline(always)]
            unsafe fn load(at: *const $sample) -> Self {
                Self(unsafe { $load(at) })
            }

            #[inline(always)]
            unsafe fn store(self, at: *mut $sample) {
                unsafe { $store(at, self.0) }
            }

            #[inline(always)]
            unsafe fn mul_add(self, factor: Self, sum: Self) -> Self {
                Self(unsafe { $fma(self.0, factor.0, sum.0) })
            }

            $(full_tile! $full;)?
        }
    };
}

#[cfg(target_arch = "x86_64")]
x86!(
    Avx2F32,
    __m256,
    f32,
    8,
    12,
    _mm256_set1_ps,
    _mm256_loadu_ps,
    _mm256_storeu_ps,
    _mm256_fmadd_ps,
    (outer)
);
#[cfg(target_arch = "x86_64")]
x86!(
    Avx2F64,
    __m256d,
    f64,
    4,
    12,
    _mm256_set1_pd,
    _mm256_loadu_pd,
    _mm256_storeu_pd,
    _mm256_fmadd_pd,
    (outer)
);
#[cfg(target_arch = "x86_64")]
x86!(Avx512F32, __m512, f32, 16, 24, _mm512_set1_ps, _mm512_loadu_ps, _mm512_storeu_ps, _mm512_fmadd_ps);
#[cfg(target_arch = "x86_64")]
x86!(Avx512F64, __m512d, f64, 8, 24, _mm512_set1_pd, _mm512_loadu_pd, _mm512_storeu_pd, _mm512_fmadd_pd);

#[cfg(target_arch = "x86_64")]
impl Avx2F32 {
    full_tile!(inner f32, _mm256_setzero_ps, _mm256_storeu_ps, "vmovups", "vbroadcastss", "vfmadd231ps", "4");
}

#[cfg(target_arch = "x86_64")]
impl Avx2F64 {
    full_tile!(inner f64, _mm256_setzero_pd, _mm256_storeu_pd, "vmovupd", "vbroadcastsd", "vfmadd231pd", "8");
}
