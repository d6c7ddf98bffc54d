//! Rows back to frames.

use super::super::dispatch::{Element, Kernel};
use super::super::vector::{Vector, group_lanes};
use super::complex::row_samples;
use std::marker::PhantomData;

/// From the last rows of a transform to the frames of the output.
pub(super) struct ScatterJob<T> {
    pub(super) rows: *const T,
    /// Samples of the rows of one group of lanes, and groups.
    pub(super) plane: usize,
    pub(super) groups: usize,
    pub(super) out: *mut T,
    pub(super) stride: usize,
    pub(super) count: usize,
}

/// Frames from the rows of D lanes each.
pub(super) struct Scatter<T, const D: usize>(PhantomData<T>);

impl<T: Element, const D: usize> Kernel for Scatter<T, D> {
    type Sample = T;
    type Job<'a> = &'a ScatterJob<T>;
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(job: &ScatterJob<T>) {
        if const { D > group_lanes::<T>() } {
            unreachable!("segments have a group of lanes at most");
        }
        let mut out = job.out;
        for segment in 0..2 * V::GROUP / D {
            // Real and imaginary parts take turns.
            let mut lanes = job.rows.wrapping_add(segment % 2 * V::GROUP + segment / 2 * D);
            for _ in 0..job.count {
                // SAFETY: the caller's.
                unsafe {
                    if D < V::GROUP {
                        out.cast::<[T; D]>().write_unaligned(lanes.cast::<[T; D]>().read_unaligned());
                    } else {
                        for g in 0..job.groups {
                            V::load(lanes.add(g * job.plane)).store(out.add(g * V::GROUP));
                        }
                    }
                }
                (lanes, out) = (lanes.wrapping_add(row_samples::<T>()), out.wrapping_add(job.stride));
            }
        }
    }
}
