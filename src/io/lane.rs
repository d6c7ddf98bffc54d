//! One input as the consumer sees it: frames in the order of time, with NaN for the lost ones.
//!
//! Nothing is copied where nothing is lost: the frames are those of the block that was read.

use super::lost::{LostOfInput, Mark};
use super::sequence::Stretch;
use super::{PcmFormat, PcmFrames, SampleLayout};
use std::collections::VecDeque;

/// Lost frames that are handed out at a time.
const LOST_FRAMES: usize = 1024;

/// What the frames of an input are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    pub(super) layout: SampleLayout,
    pub(super) channels: usize,
    /// Frames a second, where the input says.
    pub(super) rate: Option<f64>,
    /// Frames that the input is said to have.
    pub(super) promised: Option<u64>,
}

impl Shape {
    pub(super) fn frame_bytes(&self) -> usize {
        self.layout.container * self.channels
    }
}

/// Bytes that were read, whole frames.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub(super) bytes: Vec<u8>,
    pub(super) filled: usize,
}

/// What the next frames are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum View {
    /// Those of the block.
    Read,
    /// Those of the block, some channels void.
    Marked,
    /// Lost; the block stays where it is.
    Lost,
    /// Lost, since the input is over.
    Over,
}

/// The input's frames in the order of time.
#[derive(Debug)]
pub(super) struct Lane {
    pub(super) shape: Shape,
    block: Block,
    /// Bytes of the block that are used up.
    used: usize,
    /// No block will follow.
    ended: bool,
    stretches: VecDeque<Stretch>,
    /// Void samples ahead, and those that time is in.
    marks: VecDeque<Mark>,
    active: Vec<Mark>,
    /// Ticks that are over.
    time: u64,
    /// Frames of the input that are over.
    frames: u64,
    view: View,
    /// Numbers in place of lost or marked frames.
    numbers: Vec<u8>,
}

impl Lane {
    pub(super) fn new(shape: Shape) -> Self {
        Self {
            shape,
            block: Block::default(),
            used: 0,
            ended: false,
            stretches: [Stretch::Frames(u64::MAX)].into(),
            marks: VecDeque::new(),
            active: Vec::new(),
            time: 0,
            frames: 0,
            view: View::Read,
            numbers: Vec::new(),
        }
    }

    /// Says what is lost, before the first frame.
    pub(super) fn lose(&mut self, stretches: VecDeque<Stretch>, lost: LostOfInput) {
        self.stretches = stretches;
        self.marks = lost.marks.into();
        self.enter_marks();
    }

    /// Takes the next block, once the last one is used up; gives that one back.
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

    /// True if a block must come before this input can go on.
    pub(super) fn waits(&self) -> bool {
        self.ready() == 0 && !self.ended
    }

    /// True if there is nothing left, not even lost frames.
    pub(super) fn is_over(&self) -> bool {
        self.ready() == 0 && self.ended
    }

    /// Frames of the block that are left.
    pub(super) fn left(&self) -> usize {
        (self.block.filled - self.used) / self.shape.frame_bytes()
    }

    /// Frames of the input that are used or at hand.
    pub(super) fn seen(&self) -> u64 {
        self.frames + self.left() as u64
    }

    /// True if the input ended before all that was said of it.
    pub(super) fn has_unreached_stretches(&self) -> bool {
        self.stretches.len() > 1
    }

    /// Ticks that are at hand and alike.
    pub(super) fn ready(&self) -> usize {
        let (frames, most) = match self.stretches.front() {
            Some(&Stretch::Lost(count)) => (clamp(count), LOST_FRAMES),
            Some(&Stretch::Frames(count)) if self.active.is_empty() => {
                (self.left().min(clamp(count)), usize::MAX)
            }
            Some(&Stretch::Frames(count)) => (self.left().min(clamp(count)), LOST_FRAMES),
            None => (0, 0),
        };
        frames.min(most).min(clamp(self.next_border() - self.time))
    }

    /// Makes `ticks` ticks visible: at most those that are ready, or any number once the input is over.
    pub(super) fn prepare(&mut self, ticks: usize) {
        self.view = match self.stretches.front() {
            _ if self.is_over() => View::Over,
            Some(Stretch::Lost(_)) => View::Lost,
            _ if self.active.is_empty() => View::Read,
            _ => View::Marked,
        };
        match self.view {
            View::Read => {}
            View::Marked => self.decode_marked(ticks),
            View::Lost | View::Over => {
                self.numbers.clear();
                let samples = ticks * self.shape.channels;
                self.numbers.extend(std::iter::repeat_n(f64::NAN.to_le_bytes(), samples).flatten());
            }
        }
    }

    /// What was prepared.
    pub(super) fn view(&self, ticks: usize) -> PcmFrames<'_> {
        let channels = self.shape.channels;
        if self.view == View::Read {
            let bytes = &self.block.bytes[self.used..self.used + ticks * self.shape.frame_bytes()];
            return PcmFrames { layout: self.shape.layout, channels, bytes };
        }
        let layout = SampleLayout::packed(PcmFormat::F64Le);
        PcmFrames { layout, channels, bytes: &self.numbers[..ticks * channels * 8] }
    }

    /// Goes on by `ticks` ticks.
    pub(super) fn advance(&mut self, ticks: usize) {
        self.time += ticks as u64;
        if self.view == View::Over {
            return;
        }
        if self.view != View::Lost {
            self.used += ticks * self.shape.frame_bytes();
            self.frames += ticks as u64;
        }
        if let Some(Stretch::Lost(count) | Stretch::Frames(count)) = self.stretches.front_mut() {
            *count -= (*count).min(ticks as u64);
            if *count == 0 {
                self.stretches.pop_front();
            }
        }
        self.enter_marks();
    }

    fn enter_marks(&mut self) {
        let time = self.time;
        self.active.retain(|mark| mark.ticks.end > time);
        while self.marks.front().is_some_and(|mark| mark.ticks.start <= time) {
            self.active.extend(self.marks.pop_front().filter(|mark| mark.ticks.end > time));
        }
    }

    /// The next tick at which a mark begins or ends.
    fn next_border(&self) -> u64 {
        let ends = self.active.iter().map(|mark| mark.ticks.end);
        ends.chain(self.marks.front().map(|mark| mark.ticks.start)).min().unwrap_or(u64::MAX)
    }

    fn decode_marked(&mut self, ticks: usize) {
        let Shape { layout, channels, .. } = self.shape;
        let bytes = &self.block.bytes[self.used..self.used + ticks * self.shape.frame_bytes()];
        self.numbers.clear();
        for (place, sample) in bytes.chunks_exact(layout.container).enumerate() {
            let void = self.active.iter().any(|mark| mark.channel == place % channels);
            let value = if void { f64::NAN } else { layout.format.decode(sample) };
            self.numbers.extend(value.to_le_bytes());
        }
    }
}

fn clamp(count: u64) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of big-endian 16-bit samples 0, 1, 2, ..
    fn lane(channels: usize, stretches: &[Stretch], marks: &[(usize, std::ops::Range<u64>)]) -> Lane {
        let layout = SampleLayout::packed(PcmFormat::S16Be);
        let mut lane = Lane::new(Shape { layout, channels, rate: None, promised: None });
        let mark = |(channel, ticks): &(usize, std::ops::Range<u64>)| Mark {
            channel: *channel,
            ticks: ticks.clone(),
        };
        let lost = LostOfInput { marks: marks.iter().map(mark).collect(), ..LostOfInput::default() };
        lane.lose(stretches.iter().copied().collect(), lost);
        lane
    }

    /// All frames, from blocks of `block` frames, in steps of at most `step`.
    fn run(mut lane: Lane, frames: usize, block: usize, step: usize) -> Vec<Option<i16>> {
        let channels = lane.shape.channels;
        let bytes: Vec<u8> = (0..(frames * channels) as i16).flat_map(i16::to_be_bytes).collect();
        let mut blocks = bytes.chunks(2 * channels * block);
        let mut out = Vec::new();
        loop {
            if lane.waits() {
                match blocks.next() {
                    Some(bytes) => drop(lane.refill(Block { bytes: bytes.to_vec(), filled: bytes.len() })),
                    None => lane.end(),
                }
                continue;
            }
            if lane.is_over() {
                return out;
            }
            let ticks = lane.ready().min(step);
            lane.prepare(ticks);
            let frames = lane.view(ticks);
            let values =
                frames.bytes.chunks_exact(frames.layout.container).map(|b| frames.layout.format.decode(b));
            out.extend(values.map(|x| x.is_finite().then_some((x * 32768.0) as i16)));
            lane.advance(ticks);
        }
    }

    #[test]
    fn lost_frames_and_void_samples_come_out_as_nan_however_they_are_cut() {
        let stretches =
            [Stretch::Lost(2), Stretch::Frames(3), Stretch::Lost(2893), Stretch::Frames(u64::MAX)];
        // Ticks 2, 3, 4 are frames 0, 1, 2; tick 2898 is frame 3.
        let marks = [(1, 0..3), (0, 4..2899), (1, 2898..2900), (1, 2899..2901)];
        let mut want = vec![None; 4];
        want.extend([Some(0), None, Some(2), Some(3), None, Some(5)]);
        want.extend(vec![None; 2 * 2893]);
        want.extend([None, None, Some(8), None, Some(10), None, Some(12), Some(13)]);
        for (block, step) in [(1, 1), (2, 3), (5, 1000), (7, usize::MAX)] {
            assert_eq!(run(lane(2, &stretches, &marks), 7, block, step), want, "{block} {step}");
        }
    }

    #[test]
    fn an_input_that_ends_early_leaves_the_rest_unsaid() {
        let mut short = lane(1, &[Stretch::Frames(9), Stretch::Lost(4), Stretch::Frames(u64::MAX)], &[]);
        assert_eq!(
            run(lane(1, &[Stretch::Frames(3), Stretch::Lost(1)], &[]), 3, 2, 9),
            [Some(0), Some(1), Some(2), None]
        );
        let _ = short.refill(Block { bytes: vec![0; 4], filled: 4 });
        short.end();
        short.prepare(2);
        short.advance(2);
        assert!(short.is_over() && short.has_unreached_stretches() && short.seen() == 2);
        // From here on it is lost for as long as anybody asks.
        short.prepare(5);
        assert_eq!(short.view(5).frames(), 5);
        short.advance(5);
        assert!(short.is_over() && short.seen() == 2);
    }
}
