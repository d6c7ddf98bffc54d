//! One input for the consumer: frames in the order of time, with NaN for lost frames.
//!
//! Frames are copied only where samples are lost; otherwise they refer to the block that was read.

use super::lost::{Dropout, LostInInput};
use super::timestamps::Break;
use super::{PcmFormat, PcmFrames, SampleLayout, StreamHeader};
use std::collections::VecDeque;

/// Lost frames that are handed out at a time, at most: few enough for the cache, so that a long gap takes no
/// memory.
const LOST_FRAMES: usize = 1024;

/// Bytes that were read, whole frames.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub(super) bytes: Vec<u8>,
    pub(super) filled: usize,
}

/// The kind of the next frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum View {
    /// Those of the block.
    Read,
    /// Those of the block, some channels invalid.
    Dropouts,
    /// Lost; the position in the block does not change.
    Lost,
    /// Lost, since the input is over.
    Over,
}

/// The input's frames in the order of time.
#[derive(Debug)]
pub(super) struct AlignedInput {
    pub(super) header: StreamHeader,
    block: Block,
    /// Bytes of the block that are used up.
    used: usize,
    /// No block will follow.
    ended: bool,
    /// The breaks ahead, in their order.
    breaks: VecDeque<Break>,
    dropouts: Dropouts,
    /// Frames of the input that are over.
    frames: u64,
    view: View,
    /// Numbers in place of lost or partly invalid frames.
    numbers: Vec<u8>,
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
            view: View::Read,
            numbers: Vec::new(),
        }
    }

    /// Sets the lost frames; to be called before the first frame is used.
    pub(super) fn lose(&mut self, breaks: VecDeque<Break>, lost: LostInInput) {
        self.breaks = breaks;
        self.dropouts = Dropouts::new(lost.dropouts, self.header.channels);
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
        let done = self.left() == 0 && !self.block.bytes.is_empty();
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

    /// Frames of the block that are left.
    pub(super) fn left(&self) -> usize {
        (self.block.filled - self.used) / self.header.frame_bytes()
    }

    /// Frames of the input that are used or at hand.
    pub(super) fn seen(&self) -> u64 {
        self.frames + self.left() as u64
    }

    /// True if timestamps or lost frames lie beyond the frames so far.
    pub(super) fn has_unreached_breaks(&self) -> bool {
        !self.breaks.is_empty()
    }

    /// Frames that are at hand and alike.
    pub(super) fn ready(&self) -> usize {
        let change = clamp(self.dropouts.until_change());
        if let Some(Break { lost, .. }) = self.at_break() {
            return clamp(lost).min(LOST_FRAMES).min(change);
        }
        let until_break = self.breaks.front().map_or(usize::MAX, |next| clamp(next.frame - self.frames));
        let most = if self.dropouts.any() { LOST_FRAMES } else { usize::MAX };
        self.left().min(until_break).min(most).min(change)
    }

    /// Makes `frames` frames visible: at most those that are ready, or any number once the input is over.
    pub(super) fn prepare(&mut self, frames: usize) {
        self.view = match self.at_break() {
            _ if self.is_over() => View::Over,
            Some(_) => View::Lost,
            None if self.dropouts.any() => View::Dropouts,
            None => View::Read,
        };
        match self.view {
            View::Read => {}
            View::Dropouts => self.decode_with_dropouts(frames),
            View::Lost | View::Over => {
                self.numbers.clear();
                let numbers = frames * self.header.columns();
                self.numbers.extend(std::iter::repeat_n(f64::NAN.to_le_bytes(), numbers).flatten());
            }
        }
    }

    /// The prepared frames. Of complex samples each part is a channel.
    pub(super) fn view(&self, frames: usize) -> PcmFrames<'_> {
        let channels = self.header.columns();
        if self.view == View::Read {
            let bytes = &self.block.bytes[self.used..self.used + frames * self.header.frame_bytes()];
            return PcmFrames { layout: self.header.layout, channels, bytes };
        }
        let layout = SampleLayout::packed(PcmFormat::F64Le);
        PcmFrames { layout, channels, bytes: &self.numbers[..frames * channels * 8] }
    }

    /// Advances by `frames` frames.
    pub(super) fn advance(&mut self, frames: usize) {
        self.dropouts.advance(frames as u64);
        match (self.view, self.breaks.front_mut()) {
            (View::Over, _) => {}
            (View::Lost, next) => next.into_iter().for_each(|next| next.lost -= frames as u64),
            (View::Read | View::Dropouts, _) => {
                self.used += frames * self.header.frame_bytes();
                self.frames += frames as u64;
            }
        }
        while self.at_break().is_some_and(|next| next.lost == 0) {
            self.breaks.pop_front();
        }
    }

    fn decode_with_dropouts(&mut self, frames: usize) {
        let StreamHeader { layout, .. } = self.header;
        let (columns, parts) = (self.header.columns(), self.header.parts());
        let bytes = &self.block.bytes[self.used..self.used + frames * self.header.frame_bytes()];
        self.numbers.clear();
        for (index, sample) in bytes.chunks_exact(layout.container).enumerate() {
            let invalid = self.dropouts.covers(index % columns / parts);
            let value = if invalid { f64::NAN } else { layout.format.decode(sample) };
            self.numbers.extend(value.to_le_bytes());
        }
    }
}

fn clamp(count: u64) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}

/// The dropouts of an input, seen from the current frame.
///
/// Each channel needs only the frame at which its validity returns, so overlapping dropouts cost no more
/// than others: a dropout that begins while its channel is invalid moves that frame.
#[derive(Debug, Default)]
struct Dropouts {
    /// The current frame.
    time: u64,
    /// Dropouts that lie ahead, in the order of their first frames.
    ahead: VecDeque<Dropout>,
    /// Each channel is invalid before this frame.
    channels: Vec<u64>,
    /// All channels are invalid before this frame.
    all: u64,
    /// The least of these frames that lies after the current one.
    next_end: Option<u64>,
}

impl Dropouts {
    /// Dropouts in the order of their first frames, for so many channels.
    fn new(ahead: Vec<Dropout>, channels: usize) -> Self {
        let mut dropouts = Self { ahead: ahead.into(), channels: vec![0; channels], ..Self::default() };
        dropouts.enter();
        dropouts
    }

    /// True if a channel is invalid at the current frame.
    fn any(&self) -> bool {
        self.next_end.is_some()
    }

    /// True if this channel is invalid at the current frame.
    fn covers(&self, channel: usize) -> bool {
        self.all.max(self.channels[channel]) > self.time
    }

    /// Frames from the current one on in which the same channels are invalid.
    fn until_change(&self) -> u64 {
        let next = self.ahead.front().map(|dropout| dropout.frames.start);
        self.next_end.into_iter().chain(next).min().map_or(u64::MAX, |frame| frame - self.time)
    }

    /// Goes on by `frames` frames, at most to the next change.
    fn advance(&mut self, frames: u64) {
        let change = frames >= self.until_change();
        self.time += frames;
        if change {
            self.enter();
        }
    }

    /// Takes the dropouts that begin now, and those that begin while their channels are invalid anyway.
    fn enter(&mut self) {
        let time = self.time;
        while let Some(dropout) = self.ahead.front() {
            let end = match dropout.channel {
                Some(channel) => &mut self.channels[channel],
                None => &mut self.all,
            };
            if dropout.frames.start > time && (*end <= time || dropout.frames.start > *end) {
                break;
            }
            *end = dropout.frames.end.max(*end);
            self.ahead.pop_front();
        }
        let ends = self.channels.iter().copied().chain([self.all]);
        self.next_end = ends.filter(|&end| end > time).min();
    }
}

#[cfg(test)]
mod tests;
