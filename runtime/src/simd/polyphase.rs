//! Polyphase filters with their coefficients in the order of use, and the checked calls of the FIR kernels.

use super::fir::{Cut, FirKernel, Job, Part, PassFn};
use crate::aligned::Aligned;

/// Stretches of a call.
const STRETCHES: usize = 2;
/// Samples of the largest scratch: the sums of the largest tile, in the largest vectors.
const SCRATCH: usize = 768;
/// Samples of the outputs of one vector: 16 ticks of 4 phases.
const BOUNCE: usize = 64;

/// FIR filters from windows of frames to M phases.
#[derive(Debug)]
pub(crate) struct Polyphase<T: Copy + Default> {
    cut: Cut,
    /// M.
    ratio: usize,
    groups: Vec<PhaseGroup<T>>,
}

/// One to four phases that are computed together.
#[derive(Debug)]
struct PhaseGroup<T: Copy + Default> {
    first: usize,
    /// P; 1 only where there is no other phase.
    width: usize,
    /// Coefficient of place d in the step that comes s-th for the p-th sum ([`Cut::phase`]) at (s P + p) D + d.
    coefficients: Aligned<T>,
    pass: PassFn<T>,
}

/// Ticks one after another whose frames lie one after another.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stretch<'a, T> {
    /// From the past of the first tick on, see [`Cut::past`].
    pub(crate) x: &'a [T],
    /// The tick of the output that is the first one.
    pub(crate) first: usize,
    pub(crate) ticks: usize,
}

/// Its vectors are stored and loaded whole: across the border of a cache line that would take twice as long.
#[repr(align(64))]
struct Scratch<T>([T; SCRATCH]);

impl<T: Copy + Default + 'static> Polyphase<T> {
    /// `coefficient(e, p)`: of the sample e before the last one of a tick's frame, for phase p of M = `ratio`.
    pub(crate) fn new(
        kernel: &FirKernel<T>,
        cut: Cut,
        ratio: usize,
        coefficient: impl Fn(usize, usize) -> T,
    ) -> Self {
        assert!(cut.steps > 0 && (cut.depth == cut.hop || cut.depth == kernel.group()));
        let group = |(first, width)| PhaseGroup {
            first,
            width,
            coefficients: coefficients(&cut, first, width, &coefficient),
            pass: kernel.pass(cut.depth, width),
        };
        Self { cut, ratio, groups: widths(ratio).map(group).collect() }
    }

    pub(crate) fn cut(&self) -> &Cut {
        &self.cut
    }

    /// True if each frame is read only once.
    pub(crate) fn reads_once(&self) -> bool {
        self.groups.len() == 1
    }

    /// Phase p of tick t goes to `out[t M + p]`. The frame of the t-th tick of a stretch begins at
    /// `x[cut.past + t * cut.hop]`; frames past the last one, up to whole vectors, are read too and mean nothing.
    ///
    /// Returns false if an input of these ticks is not finite: it makes all outputs of its tick so, whatever the
    /// coefficients. It is false also where finite inputs led to sums, or to a total of sums, that are not.
    ///
    /// # Panics
    /// If a stretch or `out` is too short for that, or if there are more than two stretches.
    pub(crate) fn run(&self, stretches: &[Stretch<'_, T>], out: &mut [T]) -> bool {
        let (mut parts, mut whole) = ([Part::NONE; STRETCHES], true);
        // All outputs are written through this one pointer, here and in the kernels.
        let room = out.as_mut_ptr();
        for (part, stretch) in parts[..stretches.len()].iter_mut().zip(stretches) {
            *part = self.part(stretch, room, out.len());
            whole &= part.ticks == stretch.ticks;
        }
        let mut scratch = std::mem::MaybeUninit::<Scratch<T>>::uninit();
        let mut finite = true;
        for group in &self.groups {
            let job = Job {
                cut: &self.cut,
                coefficients: group.coefficients.as_ptr(),
                parts: &parts[..stretches.len()],
                first: group.first,
                out_hop: self.ratio,
                scratch: scratch.as_mut_ptr().cast(),
            };
            // SAFETY: the kernel was chosen by an `Isa`, which the processor has, the coefficients were
            // made for it and the cut, and all loads and stores lie within the bounds that `part` asserts.
            finite &= unsafe { (group.pass)(&job) };
            if !whole {
                for (part, stretch) in parts.iter().zip(stretches) {
                    // SAFETY: as above.
                    finite &= unsafe { rest(group, &job, part, stretch, room) };
                }
            }
        }
        finite
    }

    /// The whole vectors of a stretch, and of a frame of three phases without its last tick: of three phases the kernels
    /// write to the place behind them too, which belongs to the same tick, to a later one, or to none.
    #[inline(always)]
    fn part(&self, stretch: &Stretch<'_, T>, room: *mut T, len: usize) -> Part<T> {
        let Stretch { x, first, ticks } = *stretch;
        let Cut { past, hop, depth, vector, .. } = self.cut;
        let padded = (ticks + vector - 1) & !(vector - 1);
        assert!(past + padded * hop <= x.len() && (first + ticks) * self.ratio <= len);
        Part {
            x: x.as_ptr().wrapping_add(past + hop - depth),
            out: room.wrapping_add(first * self.ratio),
            ticks: ticks.saturating_sub(usize::from(self.ratio == 3)) & !(vector - 1),
        }
    }
}

/// The ticks of a stretch, a vector at most, that are left of its part.
///
/// # Safety
/// The job, the part and the stretch are those of a checked call, whose outputs begin at `room`.
unsafe fn rest<T: Copy + Default>(
    group: &PhaseGroup<T>,
    job: &Job<'_, T>,
    part: &Part<T>,
    stretch: &Stretch<'_, T>,
    room: *mut T,
) -> bool {
    let left = stretch.ticks - part.ticks;
    if left == 0 {
        return true;
    }
    let mut bounce = [T::default(); BOUNCE];
    let hop = group.width.next_power_of_two();
    let x = part.x.wrapping_add(part.ticks * job.cut.hop);
    let parts = [Part { x, out: bounce.as_mut_ptr(), ticks: job.cut.vector }];
    // SAFETY: the caller's; a vector has at most 16 ticks, so the bounce buffer holds them.
    unsafe {
        let finite = (group.pass)(&Job { parts: &parts, first: 0, out_hop: hop, ..*job });
        for (t, phases) in bounce.chunks_exact(hop).enumerate().take(left) {
            let frame = room.add((stretch.first + part.ticks + t) * job.out_hop);
            frame.add(group.first).copy_from_nonoverlapping(phases.as_ptr(), group.width);
        }
        finite
    }
}

/// M phases in groups of 4, before them one of 3 if M is odd, behind them one of 2 if that is not enough; 1 only if M is 1. Those
/// of 3 may write to the place behind them, and those behind them then write over it.
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
fn coefficients<T: Copy + Default>(
    cut: &Cut,
    first: usize,
    width: usize,
    coefficient: impl Fn(usize, usize) -> T,
) -> Aligned<T> {
    let mut coefficients = Aligned::new(cut.steps * width * cut.depth);
    for (s, step) in cut.order(width).into_iter().zip(coefficients.chunks_exact_mut(width * cut.depth)) {
        for (p, places) in step.chunks_exact_mut(cut.depth).enumerate() {
            for (d, slot) in places.iter_mut().enumerate() {
                let phase = first + cut.phase(width, p, d);
                *slot = coefficient(s * cut.depth + cut.depth - 1 - d, phase);
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
