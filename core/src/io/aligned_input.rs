//! One input for the consumer: frames in the order of time, with NaN for lost samples.

use super::StreamHeader;
use super::block::{Block, RecordedFrames};
use super::lost::{Dropout, LostInInput};
use super::timestamps::Break;
use std::collections::VecDeque;

/// Lost frames that are handed out at a time, at most: few enough for the cache, so that a long gap takes no
/// memory.
const LOST_FRAMES: usize = 1024;

/// The input's frames in the order of time.
#[derive(Debug)]
pub(super) struct AlignedInput {
    pub(super) header: StreamHeader,
    block: Block,
    /// Frames of the block that are used up.
    used: usize,
    /// No block will follow.
    ended: bool,
    /// The breaks ahead, in their order.
    breaks: VecDeque<Break>,
    dropouts: Dropouts,
    /// Frames of the input that are over.
    frames: u64,
    /// Frames in place of those that are lost; made when the first one is.
    lost: Block,
}

impl AlignedInput {
    pub(super) fn new(header: StreamHeader) -> Self {
        Self {
            header,
            block: Block::default(),
            used: 0,
            ended: false,
            breaks: VecDeque::new(),
            dropouts: Dropouts::default(),
            frames: 0,
            lost: Block::default(),
        }
    }

    /// Sets the lost frames; to be called before the first frame is used.
    pub(super) fn lose(&mut self, breaks: VecDeque<Break>, lost: LostInInput) {
        self.breaks = breaks;
        self.dropouts.ahead = lost.dropouts.into();
    }

    /// The break at the next frame.
    fn at_break(&self) -> Option<Break> {
        self.breaks.front().copied().filter(|next| next.frame == self.frames)
    }

    /// Takes the next block when the last one is used up, and returns the used one.
    pub(super) fn refill(&mut self, block: Block) -> Block {
        self.used = 0;
        std::mem::replace(&mut self.block, block)
    }

    /// The block, once it is used up.
    pub(super) fn take_used(&mut self) -> Option<Block> {
        let done = self.left() == 0 && !self.block.parts.is_empty();
        done.then(|| self.refill(Block::default()))
    }

    /// No block will follow.
    pub(super) fn end(&mut self) {
        self.ended = true;
    }

    /// True once no block will follow.
    pub(super) fn ended(&self) -> bool {
        self.ended
    }

    /// True if there is nothing left, not even lost frames.
    pub(super) fn is_over(&self) -> bool {
        self.ready() == 0 && self.ended
    }

    /// True if the next frames are lost.
    fn is_lost(&self) -> bool {
        self.at_break().is_some() || self.is_over()
    }

    /// Frames of the block that are left.
    pub(super) fn left(&self) -> usize {
        self.block.frames() - self.used
    }

    /// Frames of the input that are used or at hand.
    pub(super) fn seen(&self) -> u64 {
        self.frames + self.left() as u64
    }

    /// True if timestamps or lost frames lie beyond the frames so far.
    pub(super) fn has_unreached_breaks(&self) -> bool {
        !self.breaks.is_empty()
    }

    /// Frames that are at hand, either lost or not.
    pub(super) fn ready(&self) -> usize {
        if let Some(Break { lost, .. }) = self.at_break() {
            return clamp(lost).min(LOST_FRAMES);
        }
        let until_break = self.breaks.front().map_or(usize::MAX, |next| clamp(next.frame - self.frames));
        self.left().min(until_break)
    }

    /// Makes `frames` frames visible: at most those that are ready, or any number once the input is over.
    pub(super) fn prepare(&mut self, frames: usize) {
        if self.is_lost() {
            if self.lost.frames() < frames {
                self.lost = Block::missing(&self.header, frames.max(LOST_FRAMES));
            }
        } else {
            self.dropouts.mark(&mut self.block, self.used, frames);
        }
    }

    /// The prepared frames. Several samples of each channel in a row may be a frame.
    pub(super) fn view(&self, frames: usize, per_frame: usize) -> RecordedFrames<'_> {
        match self.is_lost() {
            true => self.lost.view(0..frames, per_frame),
            false => self.block.view(self.used..self.used + frames, per_frame),
        }
    }

    /// Appends the prepared frames to another block.
    pub(super) fn copy_to(&self, begun: &mut Block, frames: usize) {
        match self.is_lost() {
            true => begun.append(&self.lost, 0..frames),
            false => begun.append(&self.block, self.used..self.used + frames),
        }
    }

    /// Advances by `frames` frames.
    pub(super) fn advance(&mut self, frames: usize) {
        let (is_break, is_over) = (self.at_break().is_some(), self.is_over());
        self.dropouts.advance(frames);
        if is_break {
            self.breaks.front_mut().into_iter().for_each(|next| next.lost -= frames as u64);
        } else if !is_over {
            self.used += frames;
            self.frames += frames as u64;
        }
        while self.at_break().is_some_and(|next| next.lost == 0) {
            self.breaks.pop_front();
        }
    }
}

fn clamp(count: u64) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}

/// The dropouts of an input, seen from the current frame.
#[derive(Debug, Default)]
struct Dropouts {
    /// The current frame.
    time: u64,
    /// Those that begin later, in the order of their first frames.
    ahead: VecDeque<Dropout>,
    /// Those that have begun and not ended.
    begun: Vec<Dropout>,
}

impl Dropouts {
    /// Marks what is invalid of the next frames, which lie in `block` from frame `first` on.
    fn mark(&mut self, block: &mut Block, first: usize, frames: usize) {
        let end = self.time + frames as u64;
        while let Some(next) = self.ahead.front().filter(|next| next.frames.start < end) {
            // Many that overlap cost no more than one.
            match self.begun.iter_mut().rfind(|other| other.channel == next.channel) {
                Some(other) if other.frames.end >= next.frames.start => {
                    other.frames.end = next.frames.end.max(other.frames.end);
                }
                _ => self.begun.push(next.clone()),
            }
            self.ahead.pop_front();
        }
        for Dropout { channel, frames } in &self.begun {
            let place = |time: u64| first + (time.clamp(self.time, end) - self.time) as usize;
            let channels = channel.map_or(0..block.channels(), |channel| channel..channel + 1);
            channels.for_each(|channel| block.lose(channel, place(frames.start)..place(frames.end)));
        }
    }

    fn advance(&mut self, frames: usize) {
        self.time += frames as u64;
        self.begun.retain(|dropout| dropout.frames.end > self.time);
    }
}

#[cfg(test)]
mod tests;
