//! The recent past of every channel, as far as the filters look back.

use super::aligned::Aligned;
use super::sample::Sample;
use super::simd::OVERRUN;

/// Samples of a window that should stay in the first-level cache beside coefficients and output.
const CACHE_SAMPLES: usize = 4096;

/// Frames a block for `rows` rows with `history` frames of past; a multiple of every tile.
pub(crate) fn block_frames(rows: usize, history: usize) -> usize {
    (CACHE_SAMPLES / rows.max(1)).saturating_sub(history).clamp(96, 768) / 96 * 96
}

/// N rows, one a channel, each with the last `history` frames before the place of the next block.
/// Small calls move along the rows; only when these are full is the history copied to the front.
#[derive(Debug, Clone)]
pub(crate) struct Window<T: Sample> {
    samples: Aligned<T>,
    stride: usize,
    history: usize,
    /// Where the next frame goes.
    next: usize,
}

impl<T: Sample> Window<T> {
    /// N = `rows` rows of zeros for blocks of at most `block` frames.
    pub(crate) fn new(rows: usize, history: usize, block: usize) -> Self {
        let stride = Self::stride(history, block);
        Self { samples: Aligned::new(rows * stride), stride, history, next: history }
    }

    /// Samples from row to row: a line more than a multiple of 256 bytes, so that the rows do not
    /// fall on the same cache sets.
    pub(crate) fn stride(history: usize, block: usize) -> usize {
        (history + block + block / 4 + OVERRUN).next_multiple_of(64) + 16
    }

    /// All zeros, as new.
    pub(crate) fn reset(&mut self) {
        self.samples.fill(T::default());
        self.next = self.history;
    }

    /// Makes room for `frames` frames (at most a block).
    pub(crate) fn make_room(&mut self, frames: usize) {
        if self.next + frames + OVERRUN <= self.stride {
            return;
        }
        for row in self.samples.chunks_exact_mut(self.stride) {
            // One more: the next frame may be a super-tick that is filled in part.
            row.copy_within(self.next - self.history..self.next + 1, 0);
        }
        self.next = self.history;
    }

    /// All rows from the next frame on, and the samples from row to row.
    pub(crate) fn room(&mut self) -> (&mut [T], usize) {
        (&mut self.samples[self.next..], self.stride)
    }

    /// All rows, from `history` frames before the next frame on.
    pub(crate) fn view(&self) -> &[T] {
        &self.samples[self.next - self.history..]
    }

    /// As [`Window::view`], to write to.
    pub(crate) fn view_mut(&mut self) -> &mut [T] {
        &mut self.samples[self.next - self.history..]
    }

    /// The block that was written is past now.
    pub(crate) fn advance(&mut self, frames: usize) {
        self.next += frames;
    }
}
