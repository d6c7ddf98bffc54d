//! Direct polyphase FIR on frames as they lie: how windows are cut, and the checked calls of the kernels.
//!
//! A tick's window is cut into steps of D samples. Each lane sums one place of the steps with fused multiply-adds from 0,
//! and at the end the D lanes of a tick are added as said in `lanes`. Two to four phases are the work of `phases`, a single
//! one is that of `single`.

use super::Isa;
use super::lanes::{Lanes, Plain};
use super::phases::Phases;
use super::single::{Pairing, Single};
use crate::runtime::aligned::Aligned;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m256, __m256d, __m512, __m512d};

/// One to four phases that are computed together, with their coefficients in the order of use.
#[derive(Debug, Clone)]
pub(crate) struct PhaseGroup<T: Copy + Default> {
    /// The first phase.
    pub(crate) first: usize,
    /// P, from 1 to 4; 1 only where there is no other phase.
    pub(crate) width: usize,
    /// Coefficient of place d in the step that comes s-th for the p-th sum ([`Cut::phase`]) at (s P + p) D + d.
    pub(crate) coefficients: Aligned<T>,
}

/// How the windows of all ticks are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cut {
    /// D, samples of a step: a power of two.
    pub(crate) depth: usize,
    pub(crate) steps: usize,
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
    pub(crate) fn phase(&self, width: usize, p: usize, place: usize) -> usize {
        match (width, self.depth) {
            (1, _) | (_, 1) => p,
            (3, 2) if p == 2 => p,
            (_, 2) => p & 2 | (p + place) & 1,
            (3, _) => p,
            _ => (p + place) % width,
        }
    }

    /// The steps in the order of use for groups of `width` phases; step 0 is the newest.
    pub(crate) fn order(&self, width: usize) -> Vec<usize> {
        if width == 1 { self.pairing.order() } else { (0..self.steps).collect() }
    }
}

/// One call of a kernel, checked.
pub(super) struct Job<'a, T> {
    pub(super) cut: &'a Cut,
    /// The newest step of the first tick.
    pub(super) x: *const T,
    pub(super) coefficients: *const T,
    pub(super) out: *mut T,
    pub(super) out_hop: usize,
    /// Ticks, a multiple of those of a vector.
    pub(super) ticks: usize,
    /// Room for the sums of a tile. It comes from outside, or else the compiler keeps it in registers, which
    /// brings back what it is to avoid.
    pub(super) scratch: *mut T,
}

/// Returns false if a sum that is looked at is not finite, or the total of those that are.
type PassFn<T> = unsafe fn(&Job<'_, T>) -> bool;

/// The kernels of one sample type.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FirKernel<T: 'static> {
    /// By depth (1, 2, 4, 8) and width (1, 2, 3, 4).
    passes: &'static [[PassFn<T>; 4]],
    /// Lanes of a group and of a vector.
    group: usize,
    lanes: usize,
}

/// Samples of the largest scratch: the sums of the largest tile, in the largest vectors.
const SCRATCH: usize = 768;
/// Samples of the outputs of one vector: 16 ticks of 4 phases.
const BOUNCE: usize = 64;

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

    /// Phase p of tick t goes to `out[t * out_hop + p]`, for the phases of `group`; of three phases the place behind them
    /// may be changed too, where it belongs to the same tick or to a later one of this call. The frame of tick t
    /// begins at `x[cut.past + t * cut.hop]`; frames past the last one, up to whole vectors, are
    /// read too and mean nothing.
    ///
    /// Returns false if an input of these ticks is not finite: it makes all outputs of its tick so, whatever the
    /// coefficients. It is false also where finite inputs led to sums, or to a total of sums, that are not.
    ///
    /// # Panics
    /// If the group, `x` or `out` is too short for that.
    pub(crate) fn run(
        &self,
        group: &PhaseGroup<T>,
        cut: &Cut,
        x: &[T],
        ticks: usize,
        out: &mut [T],
        out_hop: usize,
    ) -> bool {
        let width = group.width;
        // The last tick of three phases alone has no place behind it.
        let whole =
            (if width == 3 && out_hop == 3 { ticks.saturating_sub(1) } else { ticks }) & !(cut.vector - 1);
        let padded = if whole < ticks { whole + cut.vector } else { whole };
        assert!(cut.depth == cut.hop || cut.depth == self.group);
        assert!(cut.steps > 0 && group.coefficients.len() == cut.steps * width * cut.depth);
        assert!(cut.past + padded * cut.hop <= x.len());
        let reach = if width == 3 && out_hop > 3 { 4 } else { width };
        assert!(ticks == 0 || width <= out_hop && (ticks - 1) * out_hop + reach <= out.len());
        assert!(width > 1 || out_hop == 1);
        let pass = self.passes[cut.depth.trailing_zeros() as usize][width - 1];
        let mut scratch = std::mem::MaybeUninit::<[T; SCRATCH]>::uninit();
        let mut job = Job {
            cut,
            x: x[cut.past + cut.hop - cut.depth..].as_ptr(),
            coefficients: group.coefficients.as_ptr(),
            out: out.as_mut_ptr(),
            out_hop,
            ticks: whole,
            scratch: scratch.as_mut_ptr().cast(),
        };
        // SAFETY: the kernel was chosen for an available instruction set (`Isa::is_available`), and
        // all its loads and stores lie within the bounds asserted above.
        let mut finite = unsafe { pass(&job) };
        if whole < ticks {
            let mut bounce = [T::default(); BOUNCE];
            job.x = x[cut.past + whole * cut.hop + cut.hop - cut.depth..].as_ptr();
            let hop = width.next_power_of_two();
            (job.out, job.out_hop, job.ticks) = (bounce.as_mut_ptr(), hop, cut.vector);
            // SAFETY: as above; a vector has at most 16 ticks, so the bounce buffer holds them.
            finite &= unsafe { pass(&job) };
            for (t, phases) in (whole..ticks).zip(bounce.chunks_exact(hop)) {
                out[t * out_hop..t * out_hop + width].copy_from_slice(&phases[..width]);
            }
        }
        finite
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
                // SAFETY: the caller's, see `FirKernel::run`.
                unsafe {
                    let total = <$vector>::zero().group(0);
                    Phases::<$vector, D, P>::new(job, total).run()
                }
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn single<const D: usize>(job: &Job<'_, $sample>) -> bool {
                // SAFETY: the caller's, see `FirKernel::run`.
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
    /// The kernel for an instruction set; the portable one where the processor does not have it.
    pub(crate) fn for_f32(isa: Isa) -> Self {
        match isa {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 if isa.is_available() => avx2_f32::KERNEL,
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 if isa.is_available() => avx512_f32::KERNEL,
            _ => portable_f32::KERNEL,
        }
    }
}

impl FirKernel<f64> {
    /// The kernel for an instruction set; the portable one where the processor does not have it.
    pub(crate) fn for_f64(isa: Isa) -> Self {
        match isa {
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 if isa.is_available() => avx2_f64::KERNEL,
            #[cfg(target_arch = "x86_64")]
            Isa::Avx512 if isa.is_available() => avx512_f64::KERNEL,
            _ => portable_f64::KERNEL,
        }
    }
}
