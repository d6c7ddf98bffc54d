//! The direct polyphase algorithm for FIR filters.
//!
//! y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j], as one product of a frame's history (the last K frames as
//! they lie) with a vector of coefficients for each phase p. The order of the sum is that of the
//! [kernels](crate::simd); it is the same wherever the frame stands in its call.
//!
//! NaN and infinity are detected in the output sums, not by a pass over the input. Frames of a block whose
//! windows hold them are filtered again with zeros in their place: each frame is filtered at most twice.

use super::filter::{AlgorithmFacts, Filter, check_finite, phase_taps};
use crate::adapters::{FrameSink, FrameSource};
use crate::aligned::Aligned;
use crate::history::History;
use crate::simd::{FirKernel, Polyphase, Replaced, Segment, Tiling, not_finite, replace_not_finite};
use crate::state::{Count, StateNumbers};
use crate::{BuildError, Isa, Sample};
use std::ops::Range;

/// Samples of a block that should stay in the first-level cache beside coefficients and output.
const CACHE_SAMPLES: usize = 4096;
/// Frames of a block are a multiple of this, and so of every tile.
const BLOCK_UNIT: usize = 96;
/// Copying all frames of a call of fewer samples is cheaper than one more tile of the kernel.
const SHORT_CALL: usize = 256;

/// Coefficients in the order of use.
#[derive(Debug)]
pub(crate) struct Direct<T: Sample> {
    channels: usize,
    /// M.
    pub(crate) ratio: usize,
    /// K - 1: frames that the filters look back.
    history: usize,
    /// Frames of a [`History`], with those that only padding reaches.
    history_frames: usize,
    /// Frames of a block.
    block: usize,
    filters: Polyphase<T>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct DirectState<T: Sample> {
    history: History<T>,
    /// One block of output, for outputs of another type.
    output: Aligned<T>,
}

/// What was not finite in some frames.
struct Lost {
    /// Samples.
    count: u64,
    /// The frames whose windows hold them.
    touched: Range<usize>,
}

impl<T: Sample> Direct<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let (channels, phase_taps) = (taps.len(), phase_taps(taps, ratio));
        let kernel = FirKernel::<T>::new(isa);
        // Blocks, histories and coefficients are a few times this long; the sum must not overflow.
        let len = phase_taps
            .checked_mul(channels)
            .filter(|&len| len.saturating_mul(ratio) <= isize::MAX as usize / 64)
            .ok_or(BuildError::TooLong { history: phase_taps - 1, channels })?;
        let tiling = kernel.tiling(channels, len, ratio);
        // A short block of one channel would show what a block costs. Outputs of more than one group of
        // phases are written in several passes, and must stay in the cache too.
        let most = if channels == 1 && ratio <= 4 { 16 * BLOCK_UNIT } else { 8 * BLOCK_UNIT };
        let block = (CACHE_SAMPLES / channels).saturating_sub(phase_taps).clamp(BLOCK_UNIT, most)
            / BLOCK_UNIT
            * BLOCK_UNIT;
        let coefficient = |element, phase| T::from_f64(coefficient(taps, ratio, element, phase));
        let filters = Polyphase::new(kernel, tiling, ratio, coefficient);
        let history_frames = tiling.history.div_ceil(channels);
        Ok(Self { channels, ratio, history: phase_taps - 1, history_frames, block, filters, isa })
    }

    /// N K: multiply-adds for each output sample, without those by padding.
    pub(crate) fn multiply_adds(&self) -> f64 {
        (self.channels * (self.history + 1)) as f64
    }

    /// Frames that a state must know.
    #[cfg(feature = "rayon")]
    pub(crate) fn history_frames(&self) -> usize {
        self.history_frames
    }

    /// Frames at the beginning of a call that go through the state's history although the others need not:
    /// those whose history is there, and as many as it takes for the others to fill vectors. `None` if all
    /// had better go there.
    fn head(&self, frames: usize) -> Option<usize> {
        let vector = self.filters.tiling.vector;
        let head = self.history_frames + (frames.wrapping_sub(self.history_frames) & (vector - 1));
        let pays = frames * self.channels >= SHORT_CALL && frames >= 2 * head;
        (pays && head <= self.block).then_some(head)
    }

    /// Filters samples in the caller's memory to outputs there, block by block; returns how many were not
    /// finite and were taken as 0. Frames whose windows hold some of these go through the history.
    ///
    /// The head is filtered last in its block: its loads would straddle recent stores, and store forwarding
    /// would stall.
    fn process_in_memory(&self, history: &mut History<T>, samples: &[T], head: usize, out: &mut [T]) -> u64 {
        let (n, &Tiling { history: before, vector, .. }) = (self.channels, &self.filters.tiling);
        let frames = samples.len() / n;
        let segment = |first: usize, end: usize| {
            let x = &samples[first * n - before..end * n];
            Segment { x, first, frames: end - first }
        };
        // Whole vectors, so that all blocks after it are whole vectors too.
        let first = head + ((self.block - head) & !(vector - 1));
        let (mut done, mut end, mut replaced) = (0, frames.min(first), 0);
        // The history is that of frame `followed`. Windows of frames before `clean` may hold NaN.
        let (mut followed, mut clean) = (0, 0);
        while done < frames {
            let filtered = done >= clean;
            let finite = filtered
                && if done == 0 {
                    history.room(head).copy_from_slice(&samples[..head * n]);
                    let begin = Segment { x: history.view(), first: 0, frames: head };
                    self.filters.run(&[segment(head, end), begin], out)
                } else {
                    self.filters.run(&[segment(done, end)], out)
                };
            if !finite {
                let again = if filtered { self.suspects(samples, done..end) } else { done..end };
                if followed < again.start {
                    history.load(&samples[..again.start * n]);
                }
                history.room(again.len()).copy_from_slice(&samples[again.start * n..again.end * n]);
                let lost = self.replace(history, again.len());
                let touched = if filtered { lost.touched.clone() } else { 0..again.len() };
                self.filter_again(history, touched, again.clone(), out);
                history.advance(again.len());
                (replaced, followed) = (replaced + lost.count, again.end);
                clean = clean.max(again.start + lost.touched.end);
                // Where there are many, more are to come: the next block is not filtered in vain.
                if 2 * lost.touched.len() > end - done {
                    clean = clean.max(end + 1);
                }
            }
            (done, end) = (end, frames.min(end + self.block));
        }
        if followed < frames {
            history.load(samples);
        }
        replaced
    }

    /// Filters at most a block through the state's history; returns how many samples were not finite and
    /// were taken as 0.
    fn process_block(
        &self,
        state: &mut DirectState<T>,
        input: &dyn FrameSource,
        frames: Range<usize>,
        output: &mut dyn FrameSink,
    ) -> u64 {
        let DirectState { history, output: block } = state;
        let (len, samples) = (frames.len(), frames.start * self.ratio..frames.end * self.ratio);
        input.load(self.isa, frames.start, history.room(len));
        let mut filter = |out: &mut [T]| {
            // Filtered first: hardly ever is there anything to replace.
            if self.filters.run(&[Segment { x: history.view(), first: 0, frames: len }], out) {
                return 0;
            }
            let lost = self.replace(history, len);
            self.filter_again(history, lost.touched, 0..len, out);
            lost.count
        };
        let replaced = match output.slots(samples.clone()) {
            Some(slots) => filter(slots),
            None => {
                let block = &mut block[..samples.len()];
                let replaced = filter(block);
                output.store(self.isa, samples.start, block);
                replaced
            }
        };
        history.advance(len);
        replaced
    }

    /// The frames of a block in memory whose windows may hold samples that are not finite.
    fn suspects(&self, samples: &[T], block: Range<usize>) -> Range<usize> {
        let n = self.channels;
        let places = not_finite(&samples[block.start * n..block.end * n]);
        let first = block.start + places.start / n;
        if first < self.history_frames {
            // The windows of the first frames begin in the history.
            return block;
        }
        first..block.end.min(block.start + places.end.div_ceil(n) + self.history_frames)
    }

    /// Zeros in place of what is not finite in the frames of the history's room.
    fn replace(&self, history: &mut History<T>, frames: usize) -> Lost {
        let Replaced { count, places } = replace_not_finite(self.isa, history.room(frames));
        let reach = if count > 0 { self.history_frames } else { 0 };
        Lost { count, touched: places.start / self.channels..places.end.div_ceil(self.channels) + reach }
    }

    /// Filters `touched` of the frames in the history's room, whose outputs are those of a range of frames.
    fn filter_again(&self, history: &History<T>, touched: Range<usize>, frames: Range<usize>, out: &mut [T]) {
        // Whole vectors take least time.
        let len = touched.len().next_multiple_of(self.filters.tiling.vector);
        let len = len.min(frames.len() - touched.start);
        let x = &history.view()[touched.start * self.channels..];
        self.filters.run(&[Segment { x, first: frames.start + touched.start, frames: len }], out);
    }

    /// A state before frame `first` of `input`, as if all frames before it had been processed: at least
    /// [`Direct::history_frames`] of them.
    #[cfg(feature = "rayon")]
    pub(crate) fn state_at(&self, input: &dyn FrameSource, first: usize) -> DirectState<T> {
        let mut samples = vec![T::default(); self.history_frames * self.channels];
        input.load(self.isa, first - self.history_frames, &mut samples);
        // They are counted where they are processed.
        replace_not_finite(self.isa, &mut samples);
        let mut state = self.state();
        state.history.load(&samples);
        state
    }
}

impl<T: Sample> Filter for Direct<T> {
    type State = DirectState<T>;

    fn facts(&self) -> AlgorithmFacts {
        AlgorithmFacts {
            name: "direct",
            history: Some(self.history),
            delay: 0,
            alignment: 1,
            transform: None,
            multiply_adds: Some(self.multiply_adds()),
        }
    }

    fn state(&self) -> DirectState<T> {
        let (n, &Tiling { history, vector, .. }) = (self.channels, &self.filters.tiling);
        DirectState {
            history: History::new(n, history, self.block * n, vector * n),
            output: Aligned::new(self.ratio * self.block),
        }
    }

    fn reset(state: &mut DirectState<T>) {
        state.history.reset();
    }

    fn process(
        &self,
        state: &mut DirectState<T>,
        input: &dyn FrameSource,
        output: &mut dyn FrameSink,
    ) -> u64 {
        let frames = input.frames();
        if let (Some(head), Some(samples)) = (self.head(frames), input.in_memory())
            && let Some(out) = output.slots(0..frames * self.ratio)
        {
            return self.process_in_memory(&mut state.history, samples, head, out);
        }
        let (mut done, mut replaced) = (0, 0);
        while done < frames {
            let end = frames.min(done + self.block);
            replaced += self.process_block(state, input, done..end, output);
            done = end;
        }
        replaced
    }

    fn count(&self, _place: usize) -> Count {
        Count { inputs: self.history * self.channels, sums: 0 }
    }

    fn save(&self, state: &DirectState<T>, put: &mut dyn FnMut(f64)) {
        state.history.save(self.history, put);
    }

    fn resume(&self, state: &mut DirectState<T>, _place: usize, numbers: StateNumbers<'_>) {
        state.history.resume(self.history, numbers);
    }
}

/// Coefficient of the sample `element` samples before the last one of a frame.
fn coefficient(taps: &[Vec<f64>], ratio: usize, element: usize, phase: usize) -> f64 {
    let n = taps.len();
    let (lag, channel) = (element / n, n - 1 - element % n);
    taps[channel].get(phase + lag * ratio).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
