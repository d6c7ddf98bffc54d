//! FIR banks: the direct polyphase form.
//!
//! y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j], as one product of the tick's window (the last K frames as
//! they lie) with a vector of coefficients for each phase p. The order of the sum is that of
//! [`simd`](super::simd); it is the same wherever the tick stands in its call.

use super::BuildError;
use super::aligned::Aligned;
use super::sample::Sample;
use super::simd::{FirKernel, Isa, Polyphase, Segment, Tiling};
use super::ticks::{FastSink, TickSource};
use super::window::Window;
use std::ops::Range;

/// Samples of a block that should stay in the first-level cache beside coefficients and output.
const CACHE_SAMPLES: usize = 4096;
/// Ticks of a block are a multiple of this, and so of every tile.
const BLOCK_UNIT: usize = 96;
/// Copying all frames of a call of fewer samples is cheaper than one more tile of the kernel.
const SHORT_CALL: usize = 256;
/// Blocks that are taken at once where each frame is read only once, so that the cache does not matter.
const SPAN_BLOCKS: usize = 8;

/// Coefficients in the order of use; shared by all streams of a bank.
#[derive(Debug)]
pub(crate) struct FirPlan<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// K - 1: ticks that the filters look back.
    pub(crate) history: usize,
    /// Ticks that a window reaches back.
    reach: usize,
    /// Ticks of a block.
    block: usize,
    filters: Polyphase<T>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct FirState<T: Sample> {
    window: Window<T>,
    /// One block of output, for those who take another type.
    output: Aligned<T>,
}

impl<T: Sample> FirPlan<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let channels = taps.len();
        let lags = taps.iter().map(|f| f.len().div_ceil(ratio)).max().unwrap_or(0).max(1);
        let kernel = FirKernel::<T>::new(isa);
        // Blocks, windows and coefficients are a few times this long; the sum must not overflow.
        let len = lags
            .checked_mul(channels)
            .filter(|&len| len.saturating_mul(ratio) <= isize::MAX as usize / 64)
            .ok_or(BuildError::TooLong { history: lags - 1, channels })?;
        let tiling = kernel.tiling(channels, len, ratio);
        let block = (CACHE_SAMPLES / channels).saturating_sub(lags).clamp(BLOCK_UNIT, 8 * BLOCK_UNIT)
            / BLOCK_UNIT
            * BLOCK_UNIT;
        let coefficient = |element, phase| T::from_f64(coefficient(taps, ratio, element, phase));
        let filters = Polyphase::new(kernel, tiling, ratio, coefficient);
        let reach = tiling.past.div_ceil(channels);
        Ok(Self { channels, ratio, history: lags - 1, reach, block, filters, isa })
    }

    /// N K: multiply-adds for each fast sample, without those by padding.
    pub(crate) fn multiply_adds(&self) -> f64 {
        (self.channels * (self.history + 1)) as f64
    }

    /// A stream's state before its first tick.
    pub(crate) fn state(&self) -> FirState<T> {
        FirState { window: self.window(self.block, 0), output: Aligned::new(self.ratio * self.block) }
    }

    /// Zeros, for blocks of at most `block` ticks, and with `more` ticks of the past than the filters look back.
    pub(super) fn window(&self, block: usize, more: usize) -> Window<T> {
        let (n, &Tiling { past, vector, .. }) = (self.channels, self.filters.tiling());
        Window::new(n, past + more * n, block * n, vector * n)
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut FirState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let ticks = source.ticks();
        if let (Some(frames), Some(out)) = (source.frames(), sink.slots(0..ticks * self.ratio))
            && self.where_they_lie(&mut state.window, frames, ticks, out)
        {
            return 0;
        }
        let mut replaced = 0;
        for first in (0..ticks).step_by(self.block) {
            replaced += self.through_window(state, source, first..ticks.min(first + self.block), sink);
        }
        replaced
    }

    /// Ticks of a call that go through the window although the others need not: those whose past lies elsewhere, and as
    /// many as it takes for the others to fill vectors. `None` if all had better go there.
    fn beginning(&self, ticks: usize) -> Option<usize> {
        let beginning = self.reach + (ticks.wrapping_sub(self.reach) & (self.filters.tiling().vector - 1));
        let worth_it = ticks * self.channels >= SHORT_CALL && ticks >= 2 * beginning;
        (worth_it && beginning <= self.block).then_some(beginning)
    }

    /// Filters frames in the caller's memory to outputs there, but for those at the beginning, whose past lies elsewhere; false,
    /// with the same past as before, if the beginning is too much of the call or something may not be finite.
    ///
    /// The beginning comes last: what was just copied cannot be loaded across the borders of its stores before these
    /// have reached the cache, and short calls would wait for that.
    fn where_they_lie(&self, window: &mut Window<T>, frames: &[T], ticks: usize, out: &mut [T]) -> bool {
        let Some(beginning) = self.beginning(ticks) else { return false };
        let (n, &Tiling { past, vector, .. }) = (self.channels, self.filters.tiling());
        window.room(beginning).copy_from_slice(&frames[..beginning * n]);
        let begin = Segment { x: window.view(), first: 0, frames: beginning };
        let segment = |first: usize, end: usize| {
            let x = &frames[first * n - past..end * n];
            Segment { x, first, frames: end - first }
        };
        let span = if self.filters.reads_once() { SPAN_BLOCKS * self.block } else { self.block };
        // Whole vectors, as all that follows has then.
        let mut done = ticks.min(beginning + ((span - beginning) & !(vector - 1)));
        let mut finite = self.run(&[segment(beginning, done), begin], out);
        while finite && done < ticks {
            let next = ticks.min(done + span);
            finite = self.run(&[segment(done, next)], out);
            done = next;
        }
        if finite {
            window.recall(frames);
        }
        finite
    }

    /// Ticks that a state must know.
    pub(crate) fn reach(&self) -> usize {
        self.reach
    }

    /// A state before tick `first` of `source`, as if all ticks before it had been processed: at least
    /// [`FirPlan::reach`] of them.
    pub(crate) fn state_at(&self, source: &(impl TickSource + ?Sized), first: usize) -> FirState<T> {
        let mut frames = vec![T::default(); self.reach * self.channels];
        source.gather(self.isa, first - self.reach, self.reach, &mut frames);
        // They are counted where they are processed.
        replace_not_finite(&mut frames);
        let mut state = self.state();
        state.window.recall(&frames);
        state
    }

    /// Filters at most a block; returns how many samples were not finite and were taken as 0.
    fn through_window(
        &self,
        state: &mut FirState<T>,
        source: &(impl TickSource + ?Sized),
        ticks: Range<usize>,
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let FirState { window, output } = state;
        source.gather(self.isa, ticks.start, ticks.len(), window.room(ticks.len()));
        let samples = ticks.start * self.ratio..ticks.end * self.ratio;
        let count = match sink.slots(samples.clone()) {
            Some(slots) => self.filter_room(window, ticks.len(), slots),
            None => {
                let output = &mut output[..samples.len()];
                let count = self.filter_room(window, ticks.len(), output);
                sink.store(self.isa, samples.start, output);
                count
            }
        };
        window.advance(ticks.len());
        count
    }

    /// Filters the ticks in the window's room; returns how many samples were not finite and were taken as 0.
    fn filter_room(&self, window: &mut Window<T>, ticks: usize, out: &mut [T]) -> u64 {
        // Filtered first: hardly ever is there anything to replace.
        if self.run(&[Segment { x: window.view(), first: 0, frames: ticks }], out) {
            return 0;
        }
        let count = replace_not_finite(window.room(ticks));
        if count > 0 {
            self.run(&[Segment { x: window.view(), first: 0, frames: ticks }], out);
        }
        count
    }

    /// Filters segments; false if something may not be finite.
    #[inline]
    pub(super) fn run(&self, segments: &[Segment<'_, T>], out: &mut [T]) -> bool {
        self.filters.run(segments, out)
    }
}

impl<T: Sample> FirState<T> {
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

/// Coefficient of the sample `element` samples before the last one of a tick.
fn coefficient(taps: &[Vec<f64>], ratio: usize, element: usize, phase: usize) -> f64 {
    let n = taps.len();
    let (lag, channel) = (element / n, n - 1 - element % n);
    taps[channel].get(phase + lag * ratio).copied().unwrap_or(0.0)
}
