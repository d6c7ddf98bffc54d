//! FIR banks: the direct polyphase form.
//!
//! y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j], as one product of the tick's window (the last K frames as
//! they lie) with a vector of coefficients for each phase p. The order of the sum is that of
//! [`simd`](super::simd); it is the same wherever the tick stands in its call.
//!
//! With one channel or one phase there is too little to share between loads: then T = 2 successive ticks
//! form one *super-tick* of N T inputs and M T outputs. A call may begin or end inside a super-tick.

use super::BuildError;
use super::aligned::Aligned;
use super::sample::Sample;
use super::simd::{Cut, FirKernel, Isa, PhaseGroup};
use super::ticks::{FastSink, TickSource};
use super::window::Window;

/// Samples of a block that should stay in the first-level cache beside coefficients and output.
const CACHE_SAMPLES: usize = 4096;
/// Super-ticks of a block are a multiple of this, and so of every tile.
const BLOCK_UNIT: usize = 96;

/// Coefficients in the order of use; shared by all streams of a bank.
#[derive(Debug)]
pub(crate) struct FirPlan<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// K - 1: ticks that the filters look back.
    pub(crate) history: usize,
    /// T: ticks in a super-tick.
    pub(crate) fold: usize,
    cut: Cut,
    /// Super-ticks in a block.
    block: usize,
    groups: Vec<PhaseGroup<T>>,
    kernel: FirKernel<T>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct FirState<T: Sample> {
    window: Window<T>,
    /// One block of output, for those who take another type.
    output: Aligned<T>,
}

/// Ticks of a call that are done together.
#[derive(Debug, Clone, Copy)]
struct Block {
    /// The first tick, from the beginning of the call.
    first: usize,
    ticks: usize,
    /// Ticks of its first super-tick that were there before.
    lead: usize,
}

impl<T: Sample> FirPlan<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let channels = taps.len();
        let lags = taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1);
        let fold = if channels == 1 || ratio == 1 { 2 } else { 1 };
        let hop = channels * fold;
        let kernel = T::fir_kernel(isa);
        // Blocks, windows and coefficients are a few times this long; the sum must not overflow.
        let len = (lags + fold - 1)
            .checked_mul(channels)
            .filter(|&len| len.saturating_mul(ratio * fold) <= isize::MAX as usize / 64)
            .ok_or(BuildError::TooLong { history: lags - 1, channels })?;
        let cut = Cut::new(hop, len, kernel.group());
        let block = (CACHE_SAMPLES / hop).saturating_sub(lags).clamp(BLOCK_UNIT, 8 * BLOCK_UNIT) / BLOCK_UNIT
            * BLOCK_UNIT;
        let coefficient = |element, phase| coefficient(taps, ratio, fold, element, phase);
        let groups =
            widths(ratio * fold).map(|(first, width)| phase_group(cut, first, width, coefficient)).collect();
        Ok(Self { channels, ratio, history: lags - 1, fold, cut, block, groups, kernel, isa })
    }

    /// N K: multiply-adds for each fast sample, without those by padding.
    pub(crate) fn multiply_adds(&self) -> f64 {
        (self.channels * (self.history + 1)) as f64
    }

    /// A stream's state before its first tick.
    pub(crate) fn state(&self) -> FirState<T> {
        let output = Aligned::new(self.ratio * self.fold * self.block);
        FirState { window: self.window(self.block, 0), output }
    }

    /// Zeros, for blocks of at most `block` super-ticks, and with `more` super-ticks of the past than the filters look
    /// back.
    pub(super) fn window(&self, block: usize, more: usize) -> Window<T> {
        let Cut { hop, .. } = self.cut;
        let beyond = self.kernel.vector_ticks(self.cut) * hop;
        Window::new(self.channels, self.fold, self.cut.past() + more * hop, block * hop, beyond)
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut FirState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let frames = source.frames::<T>();
        let mut replaced = 0;
        // Ticks of the call from which on the frames are known to be finite, and those in the window.
        let (mut clean, mut held, mut first) = (0, 0, 0);
        while first < source.ticks() {
            let lead = if held == first { state.window.lead() } else { 0 };
            let mut block = Block { first, ticks: self.block_ticks(source.ticks() - first, lead), lead };
            let in_place = frames.and_then(|frames| self.in_place(frames, clean, &mut block));
            // Filtered first and looked at afterwards, when the frames are in the cache.
            let done = in_place.is_some_and(|x| {
                self.filter(x, block, &mut state.output, sink);
                T::all_finite(self.isa, &x[self.cut.past()..])
            });
            if !done {
                if let (true, Some(frames)) = (held < first, frames) {
                    state.window.recall(&frames[..first * self.channels]);
                }
                let count = self.gather(state, source, block);
                if count > 0 {
                    (replaced, clean) = (replaced + count, first + block.ticks);
                }
                self.filter(state.window.view(), block, &mut state.output, sink);
                state.window.advance(block.ticks);
                held = first + block.ticks;
            }
            first += block.ticks;
        }
        if let (true, Some(frames)) = (held < first, frames) {
            state.window.recall(&frames[..first * self.channels]);
        }
        replaced
    }

    /// Ticks that a state must know.
    pub(crate) fn reach(&self) -> usize {
        self.cut.past().div_ceil(self.channels)
    }

    /// The last beginning of a super-tick that is not after `tick`, of a call with `lead` ticks before it.
    pub(crate) fn beginning(&self, tick: usize, lead: usize) -> usize {
        tick - (lead + tick) % self.fold
    }

    /// A state before tick `first` of `source`, as if all ticks before it had been processed: at least
    /// [`FirPlan::reach`] of them, and a super-tick begins there.
    pub(crate) fn state_at(&self, source: &(impl TickSource + ?Sized), first: usize) -> FirState<T> {
        let ticks = self.reach();
        let mut frames = vec![T::default(); ticks * self.channels];
        source.gather(self.isa, first - ticks, ticks, &mut frames);
        // They are counted where they are processed.
        replace_not_finite(&mut frames);
        let mut state = self.state();
        state.window.recall(&frames);
        state
    }

    /// At most a block, up to the end of a super-tick if there are so many.
    fn block_ticks(&self, left: usize, lead: usize) -> usize {
        left.min(self.block * self.fold - lead)
    }

    /// The block's frames with their past as they lie in the caller's memory, if they fill vectors; the block is
    /// cut to whole ones. Before there is enough past that is known to be finite a block is made short.
    fn in_place<'a>(&self, frames: &'a [T], clean: usize, block: &mut Block) -> Option<&'a [T]> {
        let (n, past) = (self.channels, self.cut.past());
        let known = (block.first - clean) * n;
        if known < past || block.lead > 0 {
            let enough = (past.saturating_sub(known)).div_ceil(n).next_multiple_of(BLOCK_UNIT * self.fold);
            block.ticks = block.ticks.min(enough.max(BLOCK_UNIT * self.fold) - block.lead);
            return None;
        }
        let unit = self.kernel.vector_ticks(self.cut) * self.fold;
        let whole = block.ticks / unit * unit;
        if whole == 0 {
            return None;
        }
        block.ticks = whole;
        Some(&frames[block.first * n - past..(block.first + whole) * n])
    }

    /// The block's frames into the window; returns how many samples were not finite and are 0 now.
    fn gather(&self, state: &mut FirState<T>, source: &(impl TickSource + ?Sized), block: Block) -> u64 {
        let room = state.window.room(block.ticks);
        source.gather(self.isa, block.first, block.ticks, room);
        if T::all_finite(self.isa, room) { 0 } else { replace_not_finite(room) }
    }

    /// Filters a block whose first super-tick's past begins at `x`.
    fn filter(&self, x: &[T], block: Block, output: &mut [T], sink: &mut (impl FastSink + ?Sized)) {
        let m = self.ratio;
        let super_ticks = (block.lead + block.ticks).div_ceil(self.fold);
        if block.lead == 0
            && block.ticks.is_multiple_of(self.fold)
            && let Some(slots) = sink.slots(block.first * m..(block.first + block.ticks) * m)
        {
            self.run(x, super_ticks, slots);
            return;
        }
        self.run(x, super_ticks, output);
        let range = block.lead * m..(block.lead + block.ticks) * m;
        sink.store(self.isa, block.first * m, &output[range]);
    }

    /// Filters super-ticks; the past of the first one begins at `x`.
    pub(super) fn run(&self, x: &[T], super_ticks: usize, out: &mut [T]) {
        for group in &self.groups {
            self.kernel.run(group, self.cut, x, super_ticks, &mut out[group.first..], self.ratio * self.fold);
        }
    }
}

impl<T: Sample> FirState<T> {
    /// Ticks of an unfinished super-tick.
    pub(crate) fn lead(&self) -> usize {
        self.window.lead()
    }

    /// As new.
    pub(crate) fn reset(&mut self) {
        self.window.reset();
    }
}

pub(super) fn check_finite<T: Sample>(taps: &[Vec<f64>]) -> Result<(), BuildError> {
    for (i, f) in taps.iter().enumerate() {
        if let Some(index) = f.iter().position(|&value| !T::from_f64(value).finite()) {
            let place = format!("the filter of channel {}", i + 1);
            return Err(BuildError::NotFinite { place, index, value: f[index] });
        }
    }
    Ok(())
}

/// Zeros in place of NaN and infinity, counted.
pub(super) fn replace_not_finite<T: Sample>(samples: &mut [T]) -> u64 {
    let mut count = 0;
    for slot in samples.iter_mut().filter(|value| !value.finite()) {
        *slot = T::default();
        count += 1;
    }
    count
}

/// M phases in groups of 4, and of 3 or 2 for the rest; there are at least 2.
pub(super) fn widths(phases: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut first = 0;
    std::iter::from_fn(move || {
        let width = match phases - first {
            0 => return None,
            5 | 6 | 9 => 3,
            left => left.min(4),
        };
        first += width;
        Some((first - width, width))
    })
}

/// Coefficient of the sample `element` samples before the last one of a super-tick, for phase r M + p:
/// phase p of the super-tick's tick r.
fn coefficient(taps: &[Vec<f64>], ratio: usize, fold: usize, element: usize, phase: usize) -> f64 {
    let n = taps.len();
    let (back, channel) = (element / n, n - 1 - element % n);
    let later = fold - 1 - phase / ratio;
    let tap = back.checked_sub(later).and_then(|lag| taps[channel].get(phase % ratio + lag * ratio));
    tap.copied().unwrap_or(0.0)
}

/// Phases first .. first + width of a super-tick, in the order of use: the newest step first, in it the
/// samples as they lie.
pub(super) fn phase_group<T: Sample>(
    cut: Cut,
    first: usize,
    width: usize,
    coefficient: impl Fn(usize, usize) -> f64,
) -> PhaseGroup<T> {
    let mut coefficients = Aligned::new(cut.steps * width * cut.depth);
    for (s, step) in coefficients.chunks_exact_mut(width * cut.depth).enumerate() {
        for (p, places) in step.chunks_exact_mut(cut.depth).enumerate() {
            for (d, slot) in places.iter_mut().enumerate() {
                *slot = T::from_f64(coefficient(s * cut.depth + cut.depth - 1 - d, first + p));
            }
        }
    }
    PhaseGroup { first, width, coefficients }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_cover_every_phase_once_and_are_never_narrow() {
        for phases in 2..100 {
            let all: Vec<_> = widths(phases).collect();
            let covered: Vec<usize> = all.iter().flat_map(|&(first, width)| first..first + width).collect();
            assert_eq!(covered, (0..phases).collect::<Vec<_>>());
            assert!(all.iter().all(|&(_, width)| (2..=4).contains(&width)), "{phases}: {all:?}");
        }
    }
}
