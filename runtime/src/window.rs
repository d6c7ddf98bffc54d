//! The recent past of a stream, as far as the filters look back, in frames as they came.

use super::aligned::Aligned;
use super::sample::Sample;

/// Frames in memory: the past, then room. Small calls move along; only when the room is used up is the past
/// copied to the front.
#[derive(Debug, Clone)]
pub(crate) struct Window<T: Sample> {
    samples: Aligned<T>,
    /// N.
    channels: usize,
    /// Samples before a tick that must stay.
    past: usize,
    /// Samples that are read past the last frame.
    beyond: usize,
    /// Where the next tick begins.
    next: usize,
}

impl<T: Sample> Window<T> {
    /// Zeros, for blocks of at most `block` samples.
    pub(crate) fn new(channels: usize, past: usize, block: usize, beyond: usize) -> Self {
        let samples = Aligned::new(past + block + block / 4 + beyond);
        Self { samples, channels, past, beyond, next: past }
    }

    /// All zeros, as new.
    pub(crate) fn reset(&mut self) {
        self.samples.fill(T::default());
        self.next = self.past;
    }

    /// Room for the next `ticks` ticks, at most a block.
    #[inline]
    pub(crate) fn room(&mut self, ticks: usize) -> &mut [T] {
        let len = ticks * self.channels;
        if self.next + len + self.beyond > self.samples.len() {
            self.samples.copy_within(self.next - self.past..self.next, 0);
            self.next = self.past;
        }
        &mut self.samples[self.next..][..len]
    }

    /// From the past of the next tick on.
    pub(crate) fn view(&self) -> &[T] {
        &self.samples[self.next - self.past..]
    }

    /// Samples of the view before the next tick.
    pub(crate) fn known(&self) -> usize {
        self.past
    }

    /// The `ticks` ticks that were written are there now.
    pub(crate) fn advance(&mut self, ticks: usize) {
        self.next += ticks * self.channels;
    }

    /// The past is the end of `frames`, which are at least as long.
    pub(crate) fn recall(&mut self, frames: &[T]) {
        self.samples[..self.past].copy_from_slice(&frames[frames.len() - self.past..]);
        self.next = self.past;
    }
}
