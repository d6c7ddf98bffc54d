//! Direct polyphase FIR on frames as they lie: P phases times R vectors of frames in registers.
//!
//! A tick's window is cut into steps of D samples, the newest first. Each lane sums one place of the steps
//! in this order with fused multiply-adds from 0, and at the end the D lanes of a tick are added as said in
//! `lanes`: one input vector serves P phases, one vector of coefficients R vectors of input.
//!
//! The end of a tile is done in two parts, because its sums are ready all at once and a long
//! chain of shuffles and stores behind them would stop the multiply-adds: the first lanes are added in
//! registers and go to scratch memory; from there they are brought into order after the next tile.

use super::Isa;
use super::lanes::{Group, Lanes, Plain};
use crate::runtime::aligned::Aligned;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m256, __m256d, __m512, __m512d};

/// Two to four phases that are computed together, with their coefficients in the order of use.
#[derive(Debug, Clone)]
pub(crate) struct PhaseGroup<T: Copy + Default> {
    /// The first phase.
    pub(crate) first: usize,
    /// P, from 2 to 4.
    pub(crate) width: usize,
    /// Coefficient of place d in step s for phase p at (s P + p) D + d.
    pub(crate) coefficients: Aligned<T>,
}

/// How the window of a tick is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cut {
    /// D, samples of a step.
    pub(crate) depth: usize,
    pub(crate) steps: usize,
    /// Samples from tick to tick; equal to D unless D fills a group.
    pub(crate) hop: usize,
}

impl Cut {
    /// Windows of at least `len` samples (no less than a hop) for ticks of `hop` samples, in a group of
    /// `group` lanes.
    pub(crate) fn new(hop: usize, len: usize, group: usize) -> Self {
        let depth = if hop < group && hop.is_power_of_two() && hop > 1 { hop } else { group };
        Self { depth, steps: len.max(hop).div_ceil(depth), hop }
    }

    /// Samples before a tick's frame that its window reaches back.
    pub(crate) fn past(self) -> usize {
        self.steps * self.depth - self.hop
    }
}

/// One call of a kernel, checked.
struct Job<T> {
    /// The newest step of the first tick.
    x: *const T,
    hop: usize,
    steps: usize,
    coefficients: *const T,
    out: *mut T,
    out_hop: usize,
    /// Ticks, a multiple of those of a vector.
    ticks: usize,
    /// Room for the sums of a tile. It comes from outside, or else the compiler keeps it in registers, which
    /// brings back what it is to avoid.
    scratch: *mut T,
}

type PassFn<T> = unsafe fn(&Job<T>);

/// The kernels of one sample type.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FirKernel<T: 'static> {
    /// By depth (2, 4, 8) and width (2, 3, 4).
    passes: &'static [[PassFn<T>; 3]],
    /// Lanes of a group and of a vector.
    group: usize,
    lanes: usize,
}

/// Samples of the largest scratch: half the sums of the largest tile, in the largest vectors.
const SCRATCH: usize = 192;
/// Samples of the outputs of one vector: 8 ticks of 4 phases.
const BOUNCE: usize = 32;

impl<T: Copy + Default + 'static> FirKernel<T> {
    /// Lanes of a group, which decides how windows are cut.
    pub(crate) fn group(&self) -> usize {
        self.group
    }

    /// Ticks of a vector: calls for a multiple of them read nothing past their last frame.
    pub(crate) fn vector_ticks(&self, cut: Cut) -> usize {
        self.lanes / cut.depth
    }

    /// Phase p of tick t goes to `out[t * out_hop + p]`, for the phases of `group`. The frame of tick t
    /// begins at `x[cut.past() + t * cut.hop]`; frames past the last one, up to whole vectors, are
    /// read too and mean nothing.
    ///
    /// # Panics
    /// If the group, `x` or `out` is too short for that.
    pub(crate) fn run(
        &self,
        group: &PhaseGroup<T>,
        cut: Cut,
        x: &[T],
        ticks: usize,
        out: &mut [T],
        out_hop: usize,
    ) {
        let vector = self.vector_ticks(cut);
        let width = group.width;
        assert!(cut.depth == cut.hop || cut.depth == self.group);
        assert!(cut.steps > 0 && group.coefficients.len() == cut.steps * width * cut.depth);
        assert!(cut.past() + ticks.next_multiple_of(vector) * cut.hop <= x.len());
        assert!(ticks == 0 || width <= out_hop && (ticks - 1) * out_hop + width <= out.len());
        let pass = self.passes[cut.depth.ilog2() as usize - 1][width - 2];
        let whole = ticks / vector * vector;
        let mut scratch = std::mem::MaybeUninit::<[T; SCRATCH]>::uninit();
        let mut job = Job {
            x: x[cut.past() + cut.hop - cut.depth..].as_ptr(),
            hop: cut.hop,
            steps: cut.steps,
            coefficients: group.coefficients.as_ptr(),
            out: out.as_mut_ptr(),
            out_hop,
            ticks: whole,
            scratch: scratch.as_mut_ptr().cast(),
        };
        // SAFETY: the kernel was chosen for an available instruction set (`Isa::is_available`), and
        // all its loads and stores lie within the bounds asserted above.
        unsafe { pass(&job) };
        if whole < ticks {
            let mut bounce = [T::default(); BOUNCE];
            job.x = x[cut.past() + whole * cut.hop + cut.hop - cut.depth..].as_ptr();
            (job.out, job.out_hop, job.ticks) = (bounce.as_mut_ptr(), width, vector);
            // SAFETY: as above; a vector has at most 8 ticks, so the bounce buffer holds them.
            unsafe { pass(&job) };
            for (t, phases) in (whole..ticks).zip(bounce.chunks_exact(width)) {
                out[t * out_hop..t * out_hop + width].copy_from_slice(phases);
            }
        }
    }
}

/// The work of one group of phases on all ticks of a job.
struct Pass<'a, V: Lanes, const D: usize, const P: usize> {
    job: &'a Job<V::Sample>,
    /// The tile in scratch: its first tick and its vectors, 0 if there is none.
    first: usize,
    waiting: usize,
}

impl<V: Lanes, const D: usize, const P: usize> Pass<'_, V, D, P> {
    /// Ticks of a group.
    const TICKS: usize = V::GROUP / D;

    /// All ticks, in tiles of nearly equal size so that no small one is left over.
    #[inline(always)]
    unsafe fn run(&mut self) {
        let vectors = self.job.ticks / (Self::TICKS * V::GROUPS);
        let count = vectors.div_ceil(V::SUMS / P).max(1);
        let (small, more) = (vectors / count, vectors % count);
        let mut first = 0;
        for t in 0..count {
            let vectors = small + usize::from(t < more);
            // SAFETY: the caller's; the tiles are all within the job.
            unsafe { self.tile_of(vectors, first) };
            first += vectors * Self::TICKS * V::GROUPS;
        }
        // SAFETY: the caller's.
        unsafe { self.settle() };
    }

    #[inline(always)]
    unsafe fn tile_of(&mut self, vectors: usize, first: usize) {
        // SAFETY: the caller's.
        unsafe {
            match vectors {
                0 => {}
                1 => self.tile::<1>(first),
                2 => self.tile::<2>(first),
                3 => self.tile::<3>(first),
                4 => self.tile::<4>(first),
                5 => self.tile::<5>(first),
                6 => self.tile::<6>(first),
                7 => self.tile::<7>(first),
                8 => self.tile::<8>(first),
                9 => self.tile::<9>(first),
                10 => self.tile::<10>(first),
                11 => self.tile::<11>(first),
                _ => self.tile::<12>(first),
            }
        }
    }

    /// R vectors from tick `first` on.
    #[inline(always)]
    unsafe fn tile<const R: usize>(&mut self, first: usize) {
        // The compiler is spared the tiles that no call asks for.
        if const { P * R > V::SUMS } {
            return;
        }
        // SAFETY: the caller's.
        unsafe {
            let sums = self.sums::<R>(first);
            self.settle();
            self.first = first;
            self.waiting = R;
            let in_order = P == D && self.job.out_hop == P;
            let to = if in_order {
                self.waiting = 0;
                self.job.out.add(first * P)
            } else {
                self.job.scratch
            };
            for g in 0..V::GROUPS {
                self.reduce(&sums, g, to);
            }
        }
    }

    /// The multiply-adds of a tile.
    #[inline(always)]
    unsafe fn sums<const R: usize>(&self, first: usize) -> [[V; R]; P] {
        let Job { hop, steps, .. } = *self.job;
        let stride = Self::TICKS * V::GROUPS * hop;
        // SAFETY: the caller's.
        unsafe {
            let mut x = self.job.x.add(first * hop);
            let mut w = self.job.coefficients;
            let mut sums = [[V::zero(); R]; P];
            if const { P == 4 && R == 3 }
                && let Some(tile) = V::full_tile::<D>(x, stride, w, steps)
            {
                for (row, full) in sums.iter_mut().zip(tile) {
                    row.copy_from_slice(&full[..R]);
                }
                return sums;
            }
            // Two steps a turn: half the loop's own work, and an end that is foreseen more often. The pointers
            // may leave the slices after the last step, where nothing is read.
            if steps % 2 == 1 {
                Self::step(x, w, hop, &mut sums);
                (x, w) = (x.wrapping_sub(D), w.wrapping_add(P * D));
            }
            for _ in 0..steps / 2 {
                Self::step(x, w, hop, &mut sums);
                Self::step(x.wrapping_sub(D), w.wrapping_add(P * D), hop, &mut sums);
                (x, w) = (x.wrapping_sub(2 * D), w.wrapping_add(2 * P * D));
            }
            sums
        }
    }

    /// One step: an input for each of R vectors, a vector of coefficients for each of P phases.
    // Indices, because a step is a product of two index ranges.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    unsafe fn step<const R: usize>(
        x: *const V::Sample,
        w: *const V::Sample,
        hop: usize,
        sums: &mut [[V; R]; P],
    ) {
        let stride = Self::TICKS * V::GROUPS * hop;
        // SAFETY: the caller's.
        unsafe {
            // The smaller side waits in registers, the other one streams through a single one:
            // together with the sums they just fit.
            if const { P < R } {
                let held: [V; P] = std::array::from_fn(|p| V::spread::<D>(w.add(p * D)));
                for r in 0..R {
                    let input = V::windows::<D>(x.add(r * stride), hop);
                    for p in 0..P {
                        sums[p][r] = input.mul_add(held[p], sums[p][r]);
                    }
                }
            } else {
                let held: [V; R] = std::array::from_fn(|r| V::windows::<D>(x.add(r * stride), hop));
                for p in 0..P {
                    let coefficient = V::spread::<D>(w.add(p * D));
                    for r in 0..R {
                        sums[p][r] = held[r].mul_add(coefficient, sums[p][r]);
                    }
                }
            }
        }
    }

    /// Adds neighbouring lanes (D = 2) or quads (D >= 4) of all sums: group after group to `to`.
    #[inline(always)]
    unsafe fn reduce<const R: usize>(&self, sums: &[[V; R]; P], g: usize, to: *mut V::Sample) {
        // SAFETY: the caller's.
        unsafe {
            let sum = |p: usize, r: usize| if p < P { sums[p][r].group(g) } else { V::zero().group(0) };
            for r in 0..R {
                let place = |index: usize| to.add((index * V::GROUPS + g) * V::GROUP);
                match (P, D) {
                    (2, 2) => V::Group::neighbours(sum(0, r), sum(1, r)).store(place(r)),
                    (2, _) if r % 2 == 1 => {}
                    (2, _) => {
                        let next = if r + 1 < R { r + 1 } else { r };
                        let quads = [sum(0, r), sum(1, r), sum(0, next), sum(1, next)];
                        V::Group::quads(quads).store(place(r / 2));
                    }
                    (_, 2) => {
                        V::Group::neighbours(sum(0, r), sum(1, r)).store(place(2 * r));
                        V::Group::neighbours(sum(2, r), sum(3, r)).store(place(2 * r + 1));
                    }
                    _ => {
                        let quads = [sum(0, r), sum(1, r), sum(2, r), sum(3, r)];
                        V::Group::quads(quads).store(place(r));
                    }
                }
            }
        }
    }

    /// Brings the tile in scratch to its place in the output.
    #[inline(always)]
    unsafe fn settle(&mut self) {
        for index in 0..self.waiting * V::GROUPS {
            let (vector, g) = (index / V::GROUPS, index % V::GROUPS);
            let tick = self.first + index * Self::TICKS;
            // SAFETY: the caller's.
            unsafe {
                match (P, D) {
                    (2, 2) => self.settle_pairs(index, tick, 0, 2),
                    (2, _) if vector % 2 == 1 => {}
                    (2, _) => {
                        let from = vector / 2 * V::GROUPS + g;
                        self.settle_quads(from, tick, 0, 2);
                        if vector + 1 < self.waiting {
                            self.settle_quads(from, tick + V::GROUPS * Self::TICKS, 2, 2);
                        }
                    }
                    (_, 2) => {
                        self.settle_pairs(2 * vector * V::GROUPS + g, tick, 0, 2);
                        self.settle_pairs((2 * vector + 1) * V::GROUPS + g, tick, 2, P - 2);
                    }
                    _ => self.settle_quads(index, tick, 0, P),
                }
            }
        }
        self.waiting = 0;
    }

    /// Two phases a tick, of which `count` go to phase `phase` and the next.
    #[inline(always)]
    unsafe fn settle_pairs(&self, group: usize, tick: usize, phase: usize, count: usize) {
        // SAFETY: the caller's.
        unsafe {
            let from = self.job.scratch.add(group * V::GROUP);
            for t in 0..Self::TICKS {
                let to = self.job.out.add((tick + t) * self.job.out_hop + phase);
                to.copy_from_nonoverlapping(from.add(2 * t), count);
            }
        }
    }

    /// Four sums a quad, of which `count` from `place` on go to the tick.
    #[inline(always)]
    unsafe fn settle_quads(&self, group: usize, tick: usize, place: usize, count: usize) {
        // SAFETY: the caller's.
        unsafe {
            let from = self.job.scratch.add(group * V::GROUP);
            for t in 0..Self::TICKS {
                let to = self.job.out.add((tick + t) * self.job.out_hop);
                if D <= 4 {
                    to.copy_from_nonoverlapping(from.add(4 * t + place), count);
                } else {
                    // The tick's lanes are both quads.
                    let quad: [V::Sample; 4] = std::array::from_fn(|i| *from.add(i) + *from.add(4 + i));
                    to.copy_from_nonoverlapping(quad.as_ptr().add(place), count);
                }
            }
        }
    }
}

/// The kernels of one instruction set, by depth and width.
macro_rules! kernels {
    ($module:ident, $vector:ty, $sample:ty, $group:literal, $lanes:literal, [$($depth:literal),*] $(, $features:literal)?) => {
        mod $module {
            use super::*;

            $(#[target_feature(enable = $features)])?
            unsafe fn run<const D: usize, const P: usize>(job: &Job<$sample>) {
                // SAFETY: the caller's, see `FirKernel::run`.
                unsafe { Pass::<$vector, D, P> { job, first: 0, waiting: 0 }.run() }
            }

            pub(super) const KERNEL: FirKernel<$sample> = FirKernel {
                passes: &[$([run::<$depth, 2>, run::<$depth, 3>, run::<$depth, 4>]),*],
                group: $group,
                lanes: $lanes,
            };
        }
    };
}

kernels!(portable_f32, Plain<f32, 8>, f32, 8, 8, [2, 4, 8]);
kernels!(portable_f64, Plain<f64, 4>, f64, 4, 4, [2, 4]);
#[cfg(target_arch = "x86_64")]
kernels!(avx2_f32, __m256, f32, 8, 8, [2, 4, 8], "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx2_f64, __m256d, f64, 4, 4, [2, 4], "avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx512_f32, __m512, f32, 8, 16, [2, 4, 8], "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma");
#[cfg(target_arch = "x86_64")]
kernels!(avx512_f64, __m512d, f64, 4, 8, [2, 4], "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma");

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
