//! An input as frames of the consumer: one sample of each of its channels, or several in a row where a
//! converter samples more often than there are frames.
//!
//! What was lost is counted in samples, so a frame may have some of its samples in one block and some in the
//! next, or some that are lost. Such a frame is put together; all others stay where they were read.

use super::aligned_input::AlignedInput;
use super::block::{Block, RecordedFrames};

/// An input whose samples make frames.
#[derive(Debug)]
pub(super) struct GroupedInput {
    pub(super) aligned: AlignedInput,
    /// Samples of each channel in a frame.
    per_frame: usize,
    /// The beginning of a frame that is put together.
    begun: Block,
}

impl GroupedInput {
    pub(super) fn new(aligned: AlignedInput, per_frame: usize) -> Self {
        Self { aligned, per_frame, begun: Block::default() }
    }

    /// Samples of each channel in a frame.
    pub(super) fn per_frame(&self) -> usize {
        self.per_frame
    }

    /// Samples of the frame that is put together.
    pub(super) fn begun(&self) -> usize {
        self.begun.frames()
    }

    /// True if a block must come before this input can go on.
    pub(super) fn waits(&self) -> bool {
        self.ready() == 0 && !self.aligned.ended()
    }

    /// True if no whole frame is left.
    pub(super) fn is_over(&self) -> bool {
        self.ready() == 0 && self.aligned.ended()
    }

    /// Frames that are at hand, at most those that are alike.
    pub(super) fn ready(&self) -> usize {
        match self.begun() {
            0 => self.aligned.ready() / self.per_frame,
            begun => usize::from(begun == self.per_frame),
        }
    }

    /// Puts a frame together from what is at hand, if no whole frame is; with `end` from what is left in
    /// all.
    pub(super) fn gather(&mut self, end: bool) {
        while self.ready() == 0 && self.aligned.ready() > 0 {
            if self.begun() == 0 {
                self.begun.begin(&self.aligned.header);
            }
            let count = self.aligned.ready().min(self.per_frame - self.begun());
            self.aligned.prepare(count);
            self.aligned.copy_to(&mut self.begun, count);
            self.aligned.advance(count);
        }
        if end && self.begun() > 0 {
            self.begun.extend_missing(self.per_frame - self.begun());
        }
    }

    /// Makes `frames` frames visible: at most those that are ready, or any number once the input is over.
    pub(super) fn prepare(&mut self, frames: usize) {
        if self.begun() == 0 {
            self.aligned.prepare(frames * self.per_frame);
        }
    }

    /// The prepared frames.
    pub(super) fn view(&self, frames: usize) -> RecordedFrames<'_> {
        match self.begun() {
            0 => self.aligned.view(frames * self.per_frame, self.per_frame),
            _ => self.begun.view(0..frames * self.per_frame, self.per_frame),
        }
    }

    /// Advances by `frames` frames.
    pub(super) fn advance(&mut self, frames: usize) {
        if self.begun() == 0 {
            self.aligned.advance(frames * self.per_frame);
        } else if frames > 0 {
            self.begun.begin(&self.aligned.header);
        }
    }
}
