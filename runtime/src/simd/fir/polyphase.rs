//! Polyphase filters with their coefficients in the order of use, and the checked calls of the FIR kernels.

use super::super::dispatch::SimdElement;
use super::super::vector::group_lanes;
#[cfg(test)]
use super::super::work;
use super::kernel::{FirFn, FirKernel};
use super::tiling::{FirJob, FrameChunk, SCRATCH, Tiling};
use crate::aligned::Aligned;

/// Segments of a call.
const SEGMENTS: usize = 2;
/// Samples of the outputs of one vector: 16 frames of 4 phases.
const VECTOR_OUTPUTS: usize = 64;

/// FIR filters from windows of frames to M phases.
#[derive(Debug)]
pub(crate) struct Polyphase<T: SimdElement> {
    pub(crate) tiling: Tiling,
    /// M.
    ratio: usize,
    groups: Vec<PhaseGroup<T>>,
}

/// One to four phases that are computed together.
#[derive(Debug)]
struct PhaseGroup<T: SimdElement> {
    first: usize,
    /// P; 1 only where there is no other phase.
    width: usize,
    /// Coefficient of lane d in the step that comes s-th for the p-th sum ([`Tiling::phase`]) at
    /// (s P + p) D + d.
    coefficients: Aligned<T>,
    kernel: FirFn<T>,
}

/// Frames that lie one after another.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segment<'a, T> {
    /// From the history of the first frame on, see [`Tiling::history`].
    pub(crate) x: &'a [T],
    /// The frame of the output that is the first one.
    pub(crate) first: usize,
    pub(crate) frames: usize,
}

/// Its vectors are stored and loaded whole: across the border of a cache line that would take twice as long.
#[repr(align(64))]
struct Scratch<T>([T; SCRATCH]);

impl<T: SimdElement> Polyphase<T> {
    /// `coefficient(e, p)`: of the sample e before the last one of a frame, for phase p of M = `ratio`.
    pub(crate) fn new(
        kernel: FirKernel<T>,
        tiling: Tiling,
        ratio: usize,
        coefficient: impl Fn(usize, usize) -> T,
    ) -> Self {
        assert!(tiling.steps > 0 && (tiling.depth == tiling.hop || tiling.depth == group_lanes::<T>()));
        let group = |(first, width)| PhaseGroup {
            first,
            width,
            coefficients: coefficients(&tiling, first, width, &coefficient),
            kernel: kernel.function(tiling.depth, width),
        };
        Self { tiling, ratio, groups: widths(ratio).map(group).collect() }
    }

    /// Phase p of frame t goes to `out[t M + p]`. The t-th frame of a segment begins at
    /// `x[tiling.history + t * tiling.hop]`; frames past the last one, up to whole vectors, are read too and
    /// mean nothing.
    ///
    /// Returns false if an input of these frames is not finite: it makes all outputs of its frame so,
    /// whatever the coefficients. It is false also where finite inputs led to sums, or to a total of sums,
    /// that are not.
    ///
    /// # Panics
    /// If a segment or `out` is too short for that, or if there are more than two segments.
    pub(crate) fn run(&self, segments: &[Segment<'_, T>], out: &mut [T]) -> bool {
        let (mut chunks, mut whole) = ([FrameChunk::NONE; SEGMENTS], true);
        // All outputs are written through this one pointer, here and in the kernels.
        let room = out.as_mut_ptr();
        for (chunk, segment) in chunks[..segments.len()].iter_mut().zip(segments) {
            *chunk = self.chunk(segment, room, out.len());
            whole &= chunk.frames == segment.frames;
            #[cfg(test)]
            work::add(segment.frames * self.tiling.steps * self.tiling.depth * self.ratio);
        }
        let mut scratch = std::mem::MaybeUninit::<Scratch<T>>::uninit();
        let mut finite = true;
        for group in &self.groups {
            let job = FirJob {
                tiling: &self.tiling,
                coefficients: group.coefficients.as_ptr(),
                chunks: &chunks[..segments.len()],
                first: group.first,
                out_hop: self.ratio,
                scratch: scratch.as_mut_ptr().cast(),
            };
            // SAFETY: the coefficients were made for the kernel and the tiling, and all loads and stores lie
            // within the bounds that `chunk` asserts.
            finite &= unsafe { (group.kernel)(&job) };
            if !whole {
                for (chunk, segment) in chunks.iter().zip(segments) {
                    // SAFETY: as above.
                    finite &= unsafe { remainder(group, &job, chunk, segment, room) };
                }
            }
        }
        finite
    }

    /// The whole vectors of a segment, and with three phases without its last frame: of three phases the
    /// kernels write to the place after them too, which belongs to the same frame, to a later one, or to
    /// none.
    #[inline(always)]
    fn chunk(&self, segment: &Segment<'_, T>, room: *mut T, len: usize) -> FrameChunk<T> {
        let Segment { x, first, frames } = *segment;
        let Tiling { history, hop, depth, vector, .. } = self.tiling;
        let padded = (frames + vector - 1) & !(vector - 1);
        assert!(history + padded * hop <= x.len() && (first + frames) * self.ratio <= len);
        FrameChunk {
            x: x.as_ptr().wrapping_add(history + hop - depth),
            out: room.wrapping_add(first * self.ratio),
            frames: frames.saturating_sub(usize::from(self.ratio == 3)) & !(vector - 1),
        }
    }
}

/// The frames of a segment, a vector at most, that are left of its chunk: all outputs of the vector go to
/// scratch, and those that are wanted from there.
///
/// # Safety
/// The job, the chunk and the segment are those of a checked call, whose outputs begin at `room`.
unsafe fn remainder<T: SimdElement>(
    group: &PhaseGroup<T>,
    job: &FirJob<'_, T>,
    chunk: &FrameChunk<T>,
    segment: &Segment<'_, T>,
    room: *mut T,
) -> bool {
    let left = segment.frames - chunk.frames;
    if left == 0 {
        return true;
    }
    let mut outputs = [T::default(); VECTOR_OUTPUTS];
    let hop = group.width.next_power_of_two();
    let x = chunk.x.wrapping_add(chunk.frames * job.tiling.hop);
    let chunks = [FrameChunk { x, out: outputs.as_mut_ptr(), frames: job.tiling.vector }];
    // A vector has at most 16 frames, so the scratch holds them.
    let finite = (group.kernel)(&FirJob { chunks: &chunks, first: 0, out_hop: hop, ..*job });
    for (t, phases) in outputs.chunks_exact(hop).enumerate().take(left) {
        let frame = room.add((segment.first + chunk.frames + t) * job.out_hop);
        frame.add(group.first).copy_from_nonoverlapping(phases.as_ptr(), group.width);
    }
    finite
}

/// M phases in groups of 4, before them one of 3 if M is odd, after them one of 2 if that is not enough,
/// and a single phase only for M = 1. A group of 3 may write to the place after it, and the next group
/// then writes over that.
fn widths(phases: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut first = 0;
    std::iter::from_fn(move || {
        let width = match phases - first {
            0 => return None,
            _ if first == 0 && phases > 1 && phases % 2 == 1 => 3,
            left => left.min(4),
        };
        first += width;
        Some((first - width, width))
    })
}

/// Coefficients of phases first .. first + width in the order of use, in each step the samples as they lie.
fn coefficients<T: SimdElement>(
    tiling: &Tiling,
    first: usize,
    width: usize,
    coefficient: impl Fn(usize, usize) -> T,
) -> Aligned<T> {
    let mut coefficients = Aligned::new(tiling.steps * width * tiling.depth);
    for (s, step) in tiling.order(width).into_iter().zip(coefficients.chunks_exact_mut(width * tiling.depth))
    {
        for (p, lanes) in step.chunks_exact_mut(tiling.depth).enumerate() {
            for (d, slot) in lanes.iter_mut().enumerate() {
                let phase = first + tiling.phase(width, p, d);
                *slot = coefficient(s * tiling.depth + tiling.depth - 1 - d, phase);
            }
        }
    }
    coefficients
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_cover_every_phase_once_and_are_never_narrow() {
        for phases in 1..100 {
            let all: Vec<_> = widths(phases).collect();
            let covered: Vec<usize> = all.iter().flat_map(|&(first, width)| first..first + width).collect();
            assert_eq!(covered, (0..phases).collect::<Vec<_>>());
            assert!(
                all.iter().all(|&(_, width)| (2..=4).contains(&width) || phases == 1),
                "{phases}: {all:?}"
            );
        }
    }
}
