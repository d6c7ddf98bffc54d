//! Filters that change while a pipeline runs.
//!
//! The stream is cut into blocks of a fixed number of frames, counted from its first frame. What is found in
//! block b changes the filters within block b + 2: block b + 1 is the time in which another thread may look
//! for it. So the frames at which filters change, and the filters, depend on the stream alone and not on how
//! it was cut into calls or how fast the other thread is. What is known beforehand also changes the
//! filters of the first two blocks.
//!
//! A change takes over the history of the stream. The outputs after it are those that the new filters would
//! have given from the beginning, so that a change of the taps by dF changes an output by dF times the
//! samples that it sees, at most ||dF|| ||x||, without a transient.
//!
//! A change may shift channels against each other by whole frames. Sample n of channel i was taken at the
//! time n T - D_i, with T the slow period. With the shift s_i, frame k holds sample k + s_i of the channel,
//! which was taken at k T - (D_i - s_i T): the delay is smaller by s_i slow periods. Two clocks that run
//! apart move a delay by slow periods without end, and shifts keep it within one of them. The outputs after
//! such a change are those of the new filters on channels that were shifted so from the beginning.

use super::PipelineError;
use super::fusion::Kept;
use crate::runtime::{Input, Isa, ProcessError, Sample, Stream};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::Builder;

/// Samples that are kept before those that the next frame needs, for shifts that become smaller.
const KEPT: i64 = 1 << 14;

/// Filters that hold from some frame on.
#[derive(Debug)]
pub struct Change {
    /// Frame of the block, from 0.
    pub frame: u64,
    /// The filters, ready to run: a stream at its beginning.
    pub stream: Stream,
    /// s_i: frame k takes sample k + s_i of channel i. One per channel.
    pub shifts: Vec<i64>,
}

/// The changes that a block leads to two blocks later, in ascending order of their frames.
type Found = Result<Vec<Change>, PipelineError>;

/// Finds on a thread of its own how the filters of a running pipeline change.
#[derive(Debug)]
pub struct Retuner {
    /// Frames of a block.
    block: usize,
    channels: Vec<Channel>,
    /// The next frame.
    position: i64,
    /// No samples come any more: what frames need beyond the last ones is no signal.
    is_over: bool,
    /// The first frame of the present block, and the shifts that hold there.
    first: i64,
    shifts: Vec<i64>,
    blocks: Sender<Vec<Vec<f64>>>,
    found: Receiver<Found>,
    /// The other thread has a block.
    is_waiting: bool,
    /// Changes to come in the present block.
    changes: VecDeque<Change>,
    /// Those of the block after the first one, if they are known beforehand.
    second: Vec<Change>,
    /// The stream that goes on from the next frame, for channels that were shifted before it. Its history
    /// waits for that frame, since it may need samples as far ahead.
    shifted: Option<Stream>,
}

/// The samples of a channel.
#[derive(Debug)]
struct Channel {
    /// What the converter delivers without a signal: before the first sample and after the last one.
    offset: f64,
    samples: VecDeque<f64>,
    /// Number of the first of `samples`.
    first: i64,
    shift: i64,
}

/// Frames of channels that are shifted against each other.
pub(super) struct ShiftedFrames<'a> {
    channels: &'a [Channel],
    first: i64,
    count: usize,
    /// The frames were filtered before: what was missing counts as no signal.
    is_history: bool,
}

impl Retuner {
    /// Starts the thread on which `find` takes the samples of block after block, one list per channel, and
    /// says what changes two blocks later. In the whole block each channel has the shift that holds at its
    /// first frame. The converters deliver `offsets` without a signal.
    ///
    /// # Errors
    /// [`PipelineError::Thread`] if there can be none.
    pub fn start(
        block: usize,
        offsets: &[f64],
        mut find: impl FnMut(&[Vec<f64>]) -> Found + Send + 'static,
    ) -> Result<Self, PipelineError> {
        let (blocks, jobs) = channel::<Vec<Vec<f64>>>();
        let (results, found) = channel();
        let work = move || jobs.iter().try_for_each(|samples| results.send(find(&samples)));
        Builder::new().spawn(work).map_err(PipelineError::Thread)?;
        let channel = |&offset: &f64| Channel { offset, samples: VecDeque::new(), first: 0, shift: 0 };
        Ok(Self {
            block: block.max(1),
            channels: offsets.iter().map(channel).collect(),
            position: 0,
            is_over: false,
            first: 0,
            shifts: vec![0; offsets.len()],
            blocks,
            found,
            is_waiting: false,
            changes: VecDeque::new(),
            second: Vec::new(),
            shifted: None,
        })
    }

    /// The same with changes in the first two blocks, which are known beforehand.
    #[must_use]
    pub fn beginning_with(self, [first, second]: [Vec<Change>; 2]) -> Self {
        Self { changes: first.into(), second, ..self }
    }

    /// Takes samples of the inputs.
    pub(super) fn push(&mut self, input: &dyn Input) -> Result<(), ProcessError> {
        let (n, given, frames) = (self.channels.len(), input.channels(), input.frames());
        if given != n {
            return Err(ProcessError::Channels { given, wanted: n });
        }
        let mut samples = vec![0.0; frames * n];
        input.load_f64(Isa::detect(), 0, &mut samples);
        for (i, channel) in self.channels.iter_mut().enumerate() {
            channel.samples.extend(samples.iter().skip(i).step_by(n));
        }
        Ok(())
    }

    /// No samples come any more.
    pub(super) fn end(&mut self) {
        self.is_over = true;
    }

    /// How many frames are next: at most `most`, and none beyond the next change or the end of the block;
    /// 0 if more samples must come first.
    pub(super) fn ready(&self, most: usize) -> usize {
        let ends = self.channels.iter().zip(&self.shifts).map(|(channel, at_first)| {
            // The block, too, needs its samples with the shifts of its first frame.
            let ahead = if self.is_over { 0 } else { channel.shift.max(*at_first).max(0) };
            channel.first + channel.samples.len() as i64 - ahead
        });
        let change = self.changes.front().map_or(self.block as u64, |change| change.frame);
        let end = ends.min().unwrap_or(self.position).min(self.first + change as i64);
        usize::try_from(end - self.position).map_or(0, |count| count.min(most))
    }

    /// The next frames.
    pub(super) fn next(&self, count: usize) -> ShiftedFrames<'_> {
        self.frames(self.position, count, false)
    }

    /// The stream that takes the next frames, if the channels are shifted before them. It has the history of
    /// the shifted channels.
    pub(super) fn shifted(&mut self) -> Result<Option<Stream>, ProcessError> {
        let Some(mut stream) = self.shifted.take() else { return Ok(None) };
        let count = stream.plan().history().unwrap_or(0);
        let history = self.frames(self.position - count as i64, count, true);
        stream.run(&history, &mut Kept { output: &mut [0.0; 0].as_mut_slice(), range: 0..0 })?;
        Ok(Some(stream))
    }

    /// Moves past `count` frames.
    pub(super) fn passed(&mut self, count: usize) -> Result<(), PipelineError> {
        self.position += count as i64;
        self.forget();
        if self.position == self.first + self.block as i64 {
            self.changes = self.receive()?.into();
            let block = self.block_samples();
            self.first = self.position;
            self.blocks.send(block).map_err(|_| PipelineError::RetunerDied)?;
            self.is_waiting = true;
            self.shifts = self.channels.iter().map(|channel| channel.shift).collect();
        }
        Ok(())
    }

    /// The stream that goes on from the next frame with the history of the running one, if the filters
    /// change there.
    pub(super) fn due(&mut self) -> Option<Stream> {
        let inside = (self.position - self.first) as u64;
        let is_due = self.changes.front().is_some_and(|change| change.frame == inside);
        let due = is_due.then(|| self.changes.pop_front()).flatten()?;
        if inside == 0 {
            self.shifts.clone_from(&due.shifts);
        }
        self.begin(due)
    }

    /// Waits for what the last block leads to.
    pub(super) fn finish(mut self) -> Result<(), PipelineError> {
        self.receive().map(drop)
    }

    fn frames(&self, first: i64, count: usize, is_history: bool) -> ShiftedFrames<'_> {
        ShiftedFrames { channels: &self.channels, first, count, is_history }
    }

    /// Begins a change; the stream if no channel is shifted.
    fn begin(&mut self, change: Change) -> Option<Stream> {
        let Change { stream, shifts, .. } = change;
        let is_shifted = self.channels.iter().zip(&shifts).any(|(channel, shift)| channel.shift != *shift);
        if !is_shifted {
            return Some(stream);
        }
        self.channels.iter_mut().zip(shifts).for_each(|(channel, shift)| channel.shift = shift);
        self.shifted = Some(stream);
        None
    }

    /// The samples of the present block by channel, with the shifts that held at its first frame.
    fn block_samples(&self) -> Vec<Vec<f64>> {
        let of = |(channel, shift): (&Channel, &i64)| {
            let first = self.first + shift;
            (first..first + self.block as i64).map(|number| channel.sample(number)).collect()
        };
        self.channels.iter().zip(&self.shifts).map(of).collect()
    }

    /// Waits for the changes of the block that the other thread has, if it has one.
    fn receive(&mut self) -> Result<Vec<Change>, PipelineError> {
        if !std::mem::take(&mut self.is_waiting) {
            return Ok(std::mem::take(&mut self.second));
        }
        let mut changes = self.found.recv().map_err(|_| PipelineError::RetunerDied)??;
        changes.retain(|change| change.frame < self.block as u64);
        Ok(changes)
    }

    /// Drops samples that neither this block nor a history needs.
    fn forget(&mut self) {
        let needed = self.first.min(self.position) - KEPT;
        for channel in &mut self.channels {
            let past = usize::try_from(needed + channel.shift.min(0) - channel.first).unwrap_or(0);
            // In large steps, so that the samples are seldom moved.
            if past > KEPT as usize {
                let past = past.min(channel.samples.len());
                channel.samples.drain(..past);
                channel.first += past as i64;
            }
        }
    }
}

impl Channel {
    fn sample(&self, number: i64) -> f64 {
        let index = usize::try_from(number - self.first).ok();
        index.and_then(|index| self.samples.get(index)).copied().unwrap_or(self.offset)
    }
}

impl ShiftedFrames<'_> {
    fn load<T: Sample>(&self, first: usize, samples: &mut [T]) {
        for (frame, slots) in (self.first + first as i64..).zip(samples.chunks_exact_mut(self.channels.len()))
        {
            for (slot, channel) in slots.iter_mut().zip(self.channels) {
                let sample = channel.sample(frame + channel.shift);
                let is_unknown = self.is_history && !sample.is_finite();
                *slot = T::from_f64(if is_unknown { channel.offset } else { sample });
            }
        }
    }
}

impl Input for ShiftedFrames<'_> {
    fn channels(&self) -> usize {
        self.channels.len()
    }

    fn frames(&self) -> usize {
        self.count
    }

    fn load_f32(&self, _: Isa, first: usize, samples: &mut [f32]) {
        self.load(first, samples);
    }

    fn load_f64(&self, _: Isa, first: usize, samples: &mut [f64]) {
        self.load(first, samples);
    }
}

#[cfg(test)]
mod tests;
