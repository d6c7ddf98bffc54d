//! Direct polyphase FIR on frames as they lie: how windows are cut, and the kernels of each instruction set.
//!
//! A tick's window is cut into steps of D samples. Each lane sums one place of the steps with fused multiply-adds from 0,
//! and at the end the D lanes of a tick are added as said in `lanes`. Two to four phases are the work of `phases`, a single
//! one is that of `single`.

use super::Isa;
use super::isa::Kind;
use super::lanes::{Lanes, Plain};
use super::phases::Phases;
use super::single::{Pairing, Single};
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m256, __m256d, __m512, __m512d};

/// How the windows of all ticks are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cut {
    /// D, samples of a step: a power of two.
    pub(super) depth: usize,
    pub(super) steps: usize,
    /// Samples from tick to tick; equal to D unless D fills a group.
    pub(crate) hop: usize,
    /// Samples before a tick's frame that its window reaches back.
    pub(crate) past: usize,
    /// Ticks of a vector, a power of two: calls for a multiple of them read nothing past their last frame.
    pub(crate) vector: usize,
    /// Bit r: whether the sums of vector r of each tile are looked at. Those of its last vector always are.
    pub(super) watched: u32,
    /// The order of steps for a single phase.
    pub(super) pairing: Pairing,
}

impl Cut {
    /// The phase that lane `place` of the p-th sum belongs to, in groups of `width` phases: along diagonals.
    pub(super) fn phase(&self, width: usize, p: usize, place: usize) -> usize {
        match (width, self.depth) {
            (1, _) | (_, 1) => p,
            (3, _) if p == 2 => p,
            (3, _) => (p + place) & 1,
            (_, 2) => p & 2 | (p + place) & 1,
            _ => (p + place) % width,
        }
    }

    /// The steps in the order of use for groups of `width` phases; step 0 is the newest.
    pub(super) fn order(&self, width: usize) -> Vec<usize> {
        if width == 1 { self.pairing.order() } else { (0..self.steps).collect() }
    }
}

/// A stretch, checked, as far as it fills vectors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part<T> {
    /// The newest step of the first tick.
    pub(super) x: *const T,
    /// The outputs of the first tick.
    pub(super) out: *mut T,
    /// A multiple of those of a vector.
    pub(super) ticks: usize,
}

impl<T> Part<T> {
    pub(super) const NONE: Self = Self { x: std::ptr::null(), out: std::ptr::null_mut(), ticks: 0 };
}

/// One call of a kernel, checked.
#[derive(Debug, Clone, Copy)]
pub(super) struct Job<'a, T> {
    pub(super) cut: &'a Cut,
    pub(super) coefficients: *const T,
    pub(super) parts: &'a [Part<T>],
    /// The first phase.
    pub(super) first: usize,
    pub(super) out_hop: usize,
    /// Room for the sums of a tile. It comes from outside, or else the compiler keeps it in registers, which
    /// brings back what it is to avoid.
    pub(super) scratch: *mut T,
}

/// Returns false if a sum that is looked at is not finite, or the total of those that are.
pub(super) type PassFn<T> = unsafe fn(&Job<'_, T>) -> bool;

/// The kernels of one sample type.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FirKernel<T: 'static> {
    /// By depth (1, 2, 4, 8) and width (1, 2, 3, 4).
    passes: &'static [[PassFn<T>; 4]],
    /// Lanes of a group and of a vector.
    group: usize,
    lanes: usize,
}

impl<T: Copy + Default + 'static> FirKernel<T> {
    /// Lanes of a group.
    pub(crate) fn group(&self) -> usize {
        self.group
    }

    /// Windows of at least `len` samples (no less than a hop) for ticks of `hop` samples and groups out of `phases`
    /// phases.
    pub(crate) fn cut(&self, hop: usize, len: usize, phases: usize) -> Cut {
        let depth = if hop < self.group && hop.is_power_of_two() { hop } else { self.group };
        let steps = len.max(hop).div_ceil(depth);
        let vector = if phases == 1 { self.group } else { self.lanes / depth };
        Cut {
            depth,
            steps,
            hop,
            past: steps * depth - hop,
            vector,
            watched: watched(steps * depth / hop, vector),
            pairing: Pairing::new(depth, hop, self.group, steps),
        }
    }

    /// The kernel for D = `depth` and P = `width`, 1 to 4.
    pub(super) fn pass(&self, depth: usize, width: usize) -> PassFn<T> {
        self.passes[depth.trailing_zeros() as usize][width - 1]
    }
}

/// The vectors of a tile that must be looked at, if an input that is not finite shows in all outputs of `reach` ticks and
/// a vector holds `ticks` of them: every one, every second, every fourth ...
fn watched(reach: usize, ticks: usize) -> u32 {
    match (reach >> ticks.trailing_zeros()).checked_ilog2().unwrap_or(0) {
        0 => !0,
        1 => 0xAAAA_AAAA,
        2 => 0x8888_8888,
        3 => 0x8080_8080,
        _ => 0x8000_8000,
    }
}

/// Vectors of the next tile if `left` of them are left: the most, or half of what is less than two such tiles.
#[inline(always)]
pub(super) fn tile(left: usize, most: usize) -> usize {
    if left >= 2 * most || left == most {
        most
    } else if left > most {
        left.div_ceil(2)
    } else {
        left
    }
}

/// The kernels of one instruction set, by depth and width.
macro_rules! kernels {
    ($module:ident, $vector:ty, $sample:ty, $group:literal, $lanes:literal, [$($depth:literal),*] $(, $features:literal)?) => {
        mod $module {
            use super::*;

            $(#[target_feature(enable = $features)])?
            unsafe fn run<const D: usize, const P: usize>(job: &Job<'_, $sample>) -> bool {
                // SAFETY: the caller's, see `Polyphase::run`.
                unsafe {
                    let total = <$vector>::zero().group(0);
                    Phases::<$vector, D, P>::new(job, total).run()
                }
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn single<const D: usize>(job: &Job<'_, $sample>) -> bool {
                // SAFETY: the caller's, see `Polyphase::run`.
                unsafe { Single::<<$vector as Lanes>::Group, D>::new(job).run() }
            }

            pub(super) const KERNEL: FirKernel<$sample> = FirKernel {
                passes: &[$([single::<$depth>, run::<$depth, 2>, run::<$depth, 3>, run::<$depth, 4>]),*],
                group: $group,
                lanes: $lanes,
            };
        }
    };
}

kernels!(portable_f32, Plain<f32, 8>, f32, 8, 8, [1, 2, 4, 8]);
kernels!(portable_f64, Plain<f64, 4>, f64, 4, 4, [1, 2, 4]);
#[cfg(target_arch = "x86_64")]
kernels!(avx2_f32, __m256, f32, 8, 8, [1, 2, 4, 8], "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx2_f64, __m256d, f64, 4, 4, [1, 2, 4], "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx512_f32, __m512, f32, 8, 16, [1, 2, 4, 8], "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx512_f64, __m512d, f64, 4, 8, [1, 2, 4], "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma");

impl FirKernel<f32> {
    /// The kernel for an instruction set.
    pub(crate) fn for_f32(isa: Isa) -> Self {
        match isa.kind() {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => avx2_f32::KERNEL,
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512 => avx512_f32::KERNEL,
            Kind::Portable => portable_f32::KERNEL,
        }
    }
}

impl FirKernel<f64> {
    /// The kernel for an instruction set.
    pub(crate) fn for_f64(isa: Isa) -> Self {
        match isa.kind() {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => avx2_f64::KERNEL,
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512 => avx512_f64::KERNEL,
            Kind::Portable => portable_f64::KERNEL,
        }
    }
}
