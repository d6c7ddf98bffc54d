//! Some of the frames of an input.

use super::Input;
use crate::{Isa, Sample};
use std::ops::Range;

/// The frames of a range of another input, where they lie.
#[derive(Debug, Clone)]
pub struct Frames<'a, I: ?Sized> {
    input: &'a I,
    range: Range<usize>,
}

impl<'a, I: Input + ?Sized> Frames<'a, I> {
    /// Frames `range` of `input`, as far as it has them.
    pub fn new(input: &'a I, range: Range<usize>) -> Self {
        let end = range.end.min(input.frames());
        Self { input, range: range.start.min(end)..end }
    }
}

impl<I: Input + ?Sized> Input for Frames<'_, I> {
    fn channels(&self) -> usize {
        self.input.channels()
    }

    fn frames(&self) -> usize {
        self.range.len()
    }

    fn in_memory<T: Sample>(&self) -> Option<&[T]> {
        let n = self.channels();
        self.input.in_memory().map(|samples| &samples[self.range.start * n..self.range.end * n])
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.input.is_finite(self.range.start + frames.start..self.range.start + frames.end)
    }

    fn load<T: Sample>(&self, isa: Isa, first: usize, samples: &mut [T]) {
        self.input.load(isa, self.range.start + first, samples);
    }
}
