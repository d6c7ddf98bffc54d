//! The FIR kernels of an instruction set, by the samples of a step and the phases of a group.

use super::super::dispatch::{Kernel, SimdElement, compiled, compiled_narrow, vector_lanes};
use super::super::isa::Isa;
use super::super::vector::{Vector, group_lanes};
use super::phases::Phases;
use super::single::Single;
use super::tiling::{FirJob, Tiling};
use std::marker::PhantomData;

/// Returns false if a sum of the first phase is not finite, or the total of them.
pub(super) type FirFn<T> = for<'a> unsafe fn(&'a FirJob<'a, T>) -> bool;

/// P phases with windows cut into steps of D samples.
struct SteppedFir<T, const D: usize, const P: usize>(PhantomData<T>);

impl<T: SimdElement, const D: usize, const P: usize> Kernel for SteppedFir<T, D, P> {
    type Sample = T;
    type Job<'a> = &'a FirJob<'a, T>;
    type Output = bool;

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(job: &FirJob<'_, T>) -> bool {
        if const { D > group_lanes::<T>() } {
            unreachable!("a step is at most a group");
        }
        if const { P == 1 } { Single::<V, D>::new(job).run() } else { Phases::<V, D, P>::new(job).run() }
    }
}

/// The kernels of one sample type on one instruction set.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FirKernel<T> {
    isa: Isa,
    sample: PhantomData<T>,
}

impl<T: SimdElement> FirKernel<T> {
    /// The kernels for an instruction set.
    pub(crate) fn new(isa: Isa) -> Self {
        Self { isa, sample: PhantomData }
    }

    /// Windows of at least `len` samples (no less than a hop) for frames of `hop` samples and `phases`
    /// phases.
    pub(crate) fn tiling(self, hop: usize, len: usize, phases: usize) -> Tiling {
        Tiling::new([hop, len, phases], group_lanes::<T>(), vector_lanes::<T>(self.isa))
    }

    /// The kernel for D = `depth` and P = `width`, 1 to 4.
    pub(super) fn function(self, depth: usize, width: usize) -> FirFn<T> {
        match depth {
            1 => self.of_depth::<1>(width),
            2 => self.of_depth::<2>(width),
            4 => self.of_depth::<4>(width),
            _ => self.of_depth::<8>(width),
        }
    }

    fn of_depth<const D: usize>(self, width: usize) -> FirFn<T> {
        match width {
            1 => compiled_narrow::<SteppedFir<T, D, 1>>(self.isa),
            2 => compiled::<SteppedFir<T, D, 2>>(self.isa),
            3 => compiled::<SteppedFir<T, D, 3>>(self.isa),
            _ => compiled::<SteppedFir<T, D, 4>>(self.isa),
        }
    }
}
