//! The recent past of a stream, as far as the filters look back, in frames as they came.

use super::aligned::Aligned;
use super::sample::Sample;

/// Frames in memory: the past, then the super-tick that is being filled, then room. Small calls move
/// along; only when the room is used up is the past copied to the front.
#[derive(Debug, Clone)]
pub(crate) struct Window<T: Sample> {
    samples: Aligned<T>,
    /// N.
    channels: usize,
    /// T, ticks of a super-tick.
    fold: usize,
    /// Samples before a super-tick that must stay.
    past: usize,
    /// Samples that are read past the last frame.
    beyond: usize,
    /// Where the next super-tick begins.
    next: usize,
    /// Ticks of it that are there already.
    lead: usize,
}

impl<T: Sample> Window<T> {
    /// Zeros, for blocks of at most `block` samples.
    pub(crate) fn new(channels: usize, fold: usize, past: usize, block: usize, beyond: usize) -> Self {
        let samples = Aligned::new(past + block + block / 4 + beyond);
        Self { samples, channels, fold, past, beyond, next: past, lead: 0 }
    }

    /// All zeros, as new.
    pub(crate) fn reset(&mut self) {
        self.samples.fill(T::default());
        (self.next, self.lead) = (self.past, 0);
    }

    /// Ticks of the next super-tick that are there already.
    pub(crate) fn lead(&self) -> usize {
        self.lead
    }

    /// Room for the next `ticks` ticks (at most a block, with those of the lead).
    pub(crate) fn room(&mut self, ticks: usize) -> &mut [T] {
        let super_ticks = (self.lead + ticks).div_ceil(self.fold);
        let held = self.lead * self.channels;
        if self.next + super_ticks * self.fold * self.channels + self.beyond > self.samples.len() {
            self.samples.copy_within(self.next - self.past..self.next + held, 0);
            self.next = self.past;
        }
        &mut self.samples[self.next + held..][..ticks * self.channels]
    }

    /// From the past of the next super-tick on.
    pub(crate) fn view(&self) -> &[T] {
        &self.samples[self.next - self.past..]
    }

    /// Samples of the view before the next tick.
    pub(crate) fn known(&self) -> usize {
        self.past + self.lead * self.channels
    }

    /// The `ticks` ticks that were written are there now.
    pub(crate) fn advance(&mut self, ticks: usize) {
        let there = self.lead + ticks;
        self.next += there / self.fold * self.fold * self.channels;
        self.lead = there % self.fold;
    }

    /// The past is the end of `frames`, whole super-ticks and at least as long.
    pub(crate) fn recall(&mut self, frames: &[T]) {
        self.samples[..self.past].copy_from_slice(&frames[frames.len() - self.past..]);
        (self.next, self.lead) = (self.past, 0);
    }
}
