//! Direct polyphase FIR on planar windows: P phases times R vectors of frames in registers.
//!
//! out[p][k] = sum_s w[s][p] x[offset_s + k]: the steps s run over channels and taps, so one
//! load of input serves P phases and one coefficient serves R vectors.

#[cfg(target_arch = "x86_64")]
use super::vector::{Avx2F32, Avx2F64, Avx512F32, Avx512F64};
use super::vector::{Portable, Vector};
use super::{Isa, OVERRUN};
use crate::runtime::aligned::Aligned;

/// Up to four phases that are computed together, with their coefficients in the order of use.
#[derive(Debug, Clone)]
pub(crate) struct PhaseGroup<T: Copy + Default> {
    /// The first phase.
    pub(crate) first: usize,
    /// P, from 1 to 4.
    pub(crate) width: usize,
    /// w[s][p] at s * P + p.
    pub(crate) coefficients: Aligned<T>,
}

/// Where each step of a kernel finds its input.
#[derive(Debug, Clone)]
pub(crate) struct Steps {
    offsets: Vec<u32>,
    /// The farthest offset.
    reach: usize,
}

impl Steps {
    pub(crate) fn new(offsets: Vec<u32>) -> Self {
        let reach = offsets.iter().max().map_or(0, |&offset| offset as usize);
        Self { offsets, reach }
    }
}

/// One call of a kernel, checked.
struct Job<T> {
    x: *const T,
    offsets: *const u32,
    steps: usize,
    coefficients: *const T,
    out: *mut T,
    out_stride: usize,
    frames: usize,
}

type GroupFn<T> = unsafe fn(&Job<T>);

/// The kernels of one sample type for P = 1..4.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FirKernel<T> {
    by_width: [GroupFn<T>; 4],
}

impl<T: Copy + Default> FirKernel<T> {
    /// out row p, frame k, for the phases of `group`: `x[offset + k]` for the step's `offset`.
    /// Frames past `frames`, up to a multiple of [`OVERRUN`], are read and written too, with
    /// values that mean nothing.
    ///
    /// # Panics
    /// If the group, `x` or `out` is too short for that.
    pub(crate) fn run(
        &self,
        group: &PhaseGroup<T>,
        x: &[T],
        steps: &Steps,
        frames: usize,
        out: &mut [T],
        out_stride: usize,
    ) {
        let padded = frames.next_multiple_of(OVERRUN);
        let offsets = &steps.offsets;
        assert!((1..=4).contains(&group.width) && group.coefficients.len() == group.width * offsets.len());
        assert!(offsets.is_empty() || steps.reach + padded <= x.len());
        assert!((group.width - 1) * out_stride + padded <= out.len());
        let job = Job {
            x: x.as_ptr(),
            offsets: offsets.as_ptr(),
            steps: offsets.len(),
            coefficients: group.coefficients.as_ptr(),
            out: out.as_mut_ptr(),
            out_stride,
            frames,
        };
        // SAFETY: the kernel was chosen for an available instruction set (`Isa::is_available`), and
        // all its loads and stores lie within the bounds asserted above.
        unsafe { self.by_width[group.width - 1](&job) }
    }
}

/// One step: an input for each of R vectors, a coefficient for each of P phases.
// Indices, because a step is a product of two index ranges.
#[allow(clippy::needless_range_loop)]
#[inline(always)]
unsafe fn step<V: Vector, const P: usize, const R: usize>(
    job: &Job<V::Sample>,
    x: *const V::Sample,
    s: usize,
    sums: &mut [[V; R]; P],
) {
    // SAFETY: the caller's, see `FirKernel::run`.
    unsafe {
        let at = x.add(*job.offsets.add(s) as usize);
        let coefficients = job.coefficients.add(s * P);
        // The smaller side waits in registers, the other one streams through a single one:
        // together with the sums they just fit.
        if const { P < R } {
            let held: [V; P] = std::array::from_fn(|p| V::splat(*coefficients.add(p)));
            for r in 0..R {
                let input = V::load(at.add(r * V::LANES));
                for p in 0..P {
                    sums[p][r] = input.mul_add(held[p], sums[p][r]);
                }
            }
        } else {
            let held: [V; R] = std::array::from_fn(|r| V::load(at.add(r * V::LANES)));
            for p in 0..P {
                let coefficient = V::splat(*coefficients.add(p));
                for r in 0..R {
                    sums[p][r] = held[r].mul_add(coefficient, sums[p][r]);
                }
            }
        }
    }
}

/// One tile: P phases, R vectors of frames from frame `first` on.
#[inline(always)]
unsafe fn tile<V: Vector, const P: usize, const R: usize>(job: &Job<V::Sample>, first: usize, zero: V) {
    // The compiler is spared the tiles that no call asks for.
    if const { P * R > V::REGISTERS } {
        return;
    }
    // SAFETY: the caller's, see `FirKernel::run`.
    unsafe {
        let mut sums = [[zero; R]; P];
        let x = job.x.add(first);
        if const { P == 4 && R == 3 }
            && job.steps > 0
            && V::full_tile(x, job.offsets, job.coefficients, job.steps, job.out.add(first), job.out_stride)
        {
            return;
        }
        // Two steps a turn: half the loop's own work.
        let mut s = 0;
        while s + 1 < job.steps {
            step::<V, P, R>(job, x, s, &mut sums);
            step::<V, P, R>(job, x, s + 1, &mut sums);
            s += 2;
        }
        if s < job.steps {
            step::<V, P, R>(job, x, s, &mut sums);
        }
        for (p, row) in sums.into_iter().enumerate() {
            for (r, sum) in row.into_iter().enumerate() {
                sum.store(job.out.add(p * job.out_stride + first + r * V::LANES));
            }
        }
    }
}

/// `count` tiles, one after another from frame `first` on.
#[inline(always)]
unsafe fn tiles<V: Vector, const P: usize, const R: usize>(
    job: &Job<V::Sample>,
    first: usize,
    count: usize,
    zero: V,
) {
    for t in 0..count {
        // SAFETY: the caller's.
        unsafe { tile::<V, P, R>(job, first + t * R * V::LANES, zero) }
    }
}

/// All frames of a job, in tiles of nearly equal size so that no small one is left over: first
/// those with one vector more, then the others.
#[inline(always)]
unsafe fn group<V: Vector, const P: usize>(job: &Job<V::Sample>, zero: V) {
    let vectors = job.frames.div_ceil(V::LANES);
    let count = vectors.div_ceil((V::REGISTERS / P).min(12)).max(1);
    let (small, more) = (vectors / count, vectors % count);
    let start = more * (small + 1) * V::LANES;
    // SAFETY: as for this function; all `vectors` vectors are within the job.
    unsafe {
        tiles_of::<V, P>(job, small + 1, 0, more, zero);
        tiles_of::<V, P>(job, small, start, count - more, zero);
    }
}

/// `count` tiles of `vectors` vectors.
#[inline(always)]
unsafe fn tiles_of<V: Vector, const P: usize>(
    job: &Job<V::Sample>,
    vectors: usize,
    first: usize,
    count: usize,
    zero: V,
) {
    // SAFETY: the caller's.
    unsafe {
        match vectors {
            0 => {}
            1 => tiles::<V, P, 1>(job, first, count, zero),
            2 => tiles::<V, P, 2>(job, first, count, zero),
            3 => tiles::<V, P, 3>(job, first, count, zero),
            4 => tiles::<V, P, 4>(job, first, count, zero),
            5 => tiles::<V, P, 5>(job, first, count, zero),
            6 => tiles::<V, P, 6>(job, first, count, zero),
            7 => tiles::<V, P, 7>(job, first, count, zero),
            8 => tiles::<V, P, 8>(job, first, count, zero),
            9 => tiles::<V, P, 9>(job, first, count, zero),
            10 => tiles::<V, P, 10>(job, first, count, zero),
            11 => tiles::<V, P, 11>(job, first, count, zero),
            _ => tiles::<V, P, 12>(job, first, count, zero),
        }
    }
}

/// The four widths of one instruction set.
macro_rules! kernels {
    ($module:ident, $vector:ty, $sample:ty $(, $features:literal)?) => {
        mod $module {
            use super::*;

            $(#[target_feature(enable = $features)])?
            unsafe fn width<const P: usize>(job: &Job<$sample>) {
                // SAFETY: the caller's, see `FirKernel::run`; the zero needs no memory.
                unsafe { group::<$vector, P>(job, <$vector>::splat(0.0)) }
            }

            pub(super) const KERNEL: FirKernel<$sample> =
                FirKernel { by_width: [width::<1>, width::<2>, width::<3>, width::<4>] };
        }
    };
}

kernels!(portable_f32, Portable<f32>, f32);
kernels!(portable_f64, Portable<f64>, f64);
#[cfg(target_arch = "x86_64")]
kernels!(avx2_f32, Avx2F32, f32, "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx2_f64, Avx2F64, f64, "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx512_f32, Avx512F32, f32, "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx512_f64, Avx512F64, f64, "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma");

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
