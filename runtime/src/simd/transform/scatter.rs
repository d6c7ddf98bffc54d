//! Rows back to frames.

use super::super::channels::ChannelVector;
use super::{group_lanes, row_samples};

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

#[inline(always)]
pub(super) unsafe fn scatter<V: ChannelVector, const D: usize>(job: &ScatterJob<V::Sample>) {
    let (row, group) = (row_samples::<V::Sample>(), group_lanes::<V::Sample>());
    let (mut out, count, stride) = (job.out, job.count, job.stride);
    for part in 0..2 * group / D {
        // Real and imaginary parts take turns.
        let mut lanes = job.rows.wrapping_add(part % 2 * group + part / 2 * D);
        for _ in 0..count {
            // SAFETY: the caller's.
            unsafe {
                if D < group {
                    out.cast::<[V::Sample; D]>()
                        .write_unaligned(lanes.cast::<[V::Sample; D]>().read_unaligned());
                } else {
                    for g in 0..job.groups {
                        for l in (0..group).step_by(V::LANES) {
                            V::load(lanes.add(g * job.plane + l)).store(out.add(g * group + l));
                        }
                    }
                }
            }
            (lanes, out) = (lanes.wrapping_add(row), out.wrapping_add(stride));
        }
    }
}
