//! Filters that change while a pipeline runs.
//!
//! The stream is cut into blocks of a fixed number of frames, counted from its first frame. What is found in
//! block b changes the filters within block b + 2: block b + 1 is the time in which another thread may look
//! for it. So the frames at which filters change, and the filters, depend on the stream alone and not on how
//! it was cut into calls or how fast the other thread is.
//!
//! A change takes over the history of the stream. The outputs after it are those that the new filters would
//! have given from the beginning, so that a change of the taps by dF changes an output by dF times the
//! samples that it sees, at most ||dF|| ||x||, without a transient.
//!
//! A change may shift channels against each other by whole frames (`shifted`). The outputs after it are
//! those of the new filters on channels that were shifted so from the beginning.

use super::shifted::ShiftedFrames;
use super::{Output, PipelineError};
use crate::bank::{Bank, SynthesisFilters};
use crate::io::{PcmFormat, PcmFrames};
use crate::runtime::{BuildError, Options, PcmOutput, Stream};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::Builder;

/// Says how the filters of a running pipeline change.
pub trait Retuner: Send {
    /// Frames of a block.
    fn block_frames(&self) -> usize;

    /// Takes the samples of the next block, one list per channel, and says what changes two blocks later. In
    /// the whole block each channel has the shift that holds at its first frame.
    fn retune(&mut self, samples: &[Vec<f64>]) -> Retuned;
}

/// What a block changes.
#[derive(Debug, Clone, Default)]
pub struct Retuned {
    /// In ascending order of their frames.
    pub changes: Vec<Retuning>,
    /// A line for a log; empty for none.
    pub record: String,
    /// What a user should know at once.
    pub warnings: Vec<String>,
}

/// Filters that hold from some frame on.
#[derive(Debug, Clone)]
pub struct Retuning {
    /// Frame of the block, from 0.
    pub frame: usize,
    /// The filters.
    pub filters: SynthesisFilters,
    /// s_i: frame k takes sample k + s_i of channel i. One per channel.
    pub shifts: Vec<i64>,
}

/// A [`Retuned`] whose filters are ready to run.
struct Ready {
    changes: Vec<Change>,
    record: String,
    warnings: Vec<String>,
}

/// A [`Retuning`] that is ready to run. The frame is that of the block, and then that of the stream.
#[derive(Debug)]
struct Change {
    frame: u64,
    stream: Stream,
    shifts: Vec<i64>,
}

/// The changes of one pipeline.
#[derive(Debug)]
pub(super) struct Tuning {
    block: usize,
    frames: ShiftedFrames,
    /// The first frame of the present block, and the shifts that hold there.
    first: u64,
    shifts: Vec<i64>,
    jobs: Sender<Vec<Vec<f64>>>,
    results: Receiver<Result<Ready, BuildError>>,
    /// The other thread has a block.
    is_waiting: bool,
    /// Changes to come.
    changes: VecDeque<Change>,
    /// The stream that goes on from the next frame, for channels that were shifted before it. Its history
    /// waits for that frame, since it may need samples as far ahead.
    shifted: Option<Stream>,
    /// Lines for the log.
    records: Vec<String>,
    /// All so far.
    pub(super) warnings: Vec<String>,
}

impl Tuning {
    /// Starts the thread that prepares the filters of `bank`.
    ///
    /// # Errors
    /// [`PipelineError::Thread`] if there can be none.
    pub(super) fn start(
        bank: &Bank,
        options: Options,
        mut retuner: Box<dyn Retuner>,
    ) -> Result<Self, PipelineError> {
        let block = retuner.block_frames().max(1);
        let (jobs, blocks) = channel::<Vec<Vec<f64>>>();
        let (ready, results) = channel();
        let (frames, channels) = (ShiftedFrames::new(&bank.offsets), bank.offsets.len());
        let mut bank = bank.clone();
        let work = move || {
            for samples in blocks {
                let found = prepared(&mut bank, options, retuner.retune(&samples));
                if ready.send(found).is_err() {
                    break;
                }
            }
        };
        Builder::new().spawn(work).map_err(PipelineError::Thread)?;
        Ok(Self {
            block,
            frames,
            first: 0,
            shifts: vec![0; channels],
            jobs,
            results,
            is_waiting: false,
            changes: VecDeque::new(),
            shifted: None,
            records: Vec::new(),
            warnings: Vec::new(),
        })
    }

    /// Takes samples of the inputs.
    pub(super) fn push(&mut self, parts: &[PcmFrames<'_>]) {
        self.frames.push(parts);
    }

    /// No samples come any more.
    pub(super) fn end(&mut self) {
        self.frames.end();
    }

    /// The next frames, interleaved: at most `most`, and none beyond the next change or the end of the
    /// block; `None` if more samples must come first.
    pub(super) fn next(&self, most: usize) -> Option<Vec<u8>> {
        let position = self.frames.position();
        let to_end = self.first + self.block as u64 - position;
        let to_change = self.changes.front().map_or(u64::MAX, |change| change.frame - position);
        let ahead = usize::try_from(to_end.min(to_change)).unwrap_or(usize::MAX);
        let count = self.frames.ready(&self.shifts).min(ahead).min(most);
        (count > 0).then(|| self.frames.next(count))
    }

    /// Frames as [`Tuning::next`] gives them.
    pub(super) fn packed<'a>(&self, bytes: &'a [u8]) -> PcmFrames<'a> {
        self.frames.packed(bytes)
    }

    /// The stream that takes the frames that [`Tuning::next`] gave, if the channels were shifted before
    /// them. It has the history of the shifted channels.
    ///
    /// # Errors
    /// [`PipelineError::Process`] for a stream of other channels.
    pub(super) fn shifted(&mut self) -> Result<Option<Stream>, PipelineError> {
        let Some(mut stream) = self.shifted.take() else { return Ok(None) };
        let count = stream.history().unwrap_or(0);
        let history = self.frames.history(count);
        let mut bytes = vec![0; count * stream.ratio() * size_of::<f64>()];
        let mut output = PcmOutput::packed(PcmFormat::F64Le, &mut bytes);
        stream.run(&[self.frames.packed(&history)][..], &mut output)?;
        Ok(Some(stream))
    }

    /// Moves past the frames that [`Tuning::next`] gave, and returns the stream that goes on from here,
    /// with the history of the running one, if the filters change.
    ///
    /// # Errors
    /// [`PipelineError::Build`] for filters that do not run.
    pub(super) fn passed(&mut self, count: usize) -> Result<Option<Stream>, PipelineError> {
        self.frames.advance(count, self.first);
        let is_end = self.frames.position() == self.first + self.block as u64;
        if is_end {
            self.end_block()?;
        }
        let position = self.frames.position();
        let is_due = self.changes.front().is_some_and(|change| change.frame == position);
        let due = is_due.then(|| self.changes.pop_front()).flatten();
        let next = due.and_then(|change| self.begin(change));
        if is_end {
            self.shifts = self.frames.shifts();
        }
        Ok(next)
    }

    /// Begins a change; the stream if no channel is shifted.
    fn begin(&mut self, change: Change) -> Option<Stream> {
        let Change { stream, shifts, .. } = change;
        if shifts == self.frames.shifts() {
            return Some(stream);
        }
        self.frames.shift_by(&shifts);
        self.shifted = Some(stream);
        None
    }

    /// Hands the block over, once the changes of the one before are known.
    fn end_block(&mut self) -> Result<(), PipelineError> {
        let next = self.first + self.block as u64;
        self.receive(next)?;
        let block = self.frames.block(self.first, self.block, &self.shifts);
        self.first = next;
        self.is_waiting = self.jobs.send(block).is_ok();
        Ok(())
    }

    /// Hands over the lines for the log.
    pub(super) fn log(&mut self, output: &mut impl Output) -> Result<(), PipelineError> {
        for line in self.records.drain(..) {
            output.log(&line)?;
        }
        Ok(())
    }

    /// Waits for the changes of the block that the other thread has.
    pub(super) fn settle(&mut self) -> Result<(), PipelineError> {
        self.receive(self.first + self.block as u64)
    }

    /// As [`Tuning::settle`]; the changes are those of the block that begins at frame `first`.
    fn receive(&mut self, first: u64) -> Result<(), PipelineError> {
        if !std::mem::take(&mut self.is_waiting) {
            return Ok(());
        }
        // A thread that is gone changes nothing any more.
        let Ok(found) = self.results.recv() else { return Ok(()) };
        let Ready { changes, record, warnings } = found?;
        let within = changes.into_iter().filter(|change| change.frame < self.block as u64);
        self.changes.extend(within.map(|change| Change { frame: first + change.frame, ..change }));
        self.records.extend(Some(record).filter(|record| !record.is_empty()));
        self.warnings.extend(warnings);
        Ok(())
    }
}

fn prepared(bank: &mut Bank, options: Options, found: Retuned) -> Result<Ready, BuildError> {
    let Retuned { changes, record, warnings } = found;
    let mut ready = Vec::with_capacity(changes.len());
    for Retuning { frame, filters, shifts } in changes {
        bank.filters = filters;
        ready.push(Change { frame: frame as u64, stream: Stream::new(&bank.plan(options)?), shifts });
    }
    Ok(Ready { changes: ready, record, warnings })
}

#[cfg(test)]
mod tests {
    use super::super::{Block, Pipeline, Settings};
    use super::*;
    use crate::io::{IoError, PcmFormat, SampleLayout};
    use crate::random::Random;
    use crate::units::Seconds;

    const BLOCK: usize = 40;
    const CHANNELS: usize = 2;
    const RATIO: usize = 2;

    /// Taps that differ from block to block and at frame 13 of a block, by what was in the block before
    /// last; the channels are shifted as [`shifts`] says.
    struct Changing {
        blocks: usize,
        is_shifting: bool,
    }

    /// The shifts at a frame: no two of them in a row are the same.
    fn shifts(block: usize, is_late: bool) -> Vec<i64> {
        let k = 2 * block + usize::from(is_late);
        vec![[0, 1, 0, -1][k % 4], [3, 0, -4, 5, 1][k % 5]]
    }

    fn taps(seed: f64) -> Vec<Vec<f64>> {
        (0..CHANNELS).map(|i| (0..9).map(|n| (seed + (3 * n + 5 * i) as f64).sin()).collect()).collect()
    }

    impl Retuner for Changing {
        fn block_frames(&self) -> usize {
            BLOCK
        }

        fn retune(&mut self, samples: &[Vec<f64>]) -> Retuned {
            assert!(samples.iter().all(|list| list.len() == BLOCK));
            self.blocks += 1;
            let at = |frame: usize| Retuning {
                frame,
                filters: SynthesisFilters::Fir(taps(samples[0][frame])),
                shifts: if self.is_shifting { shifts(self.blocks + 1, frame > 0) } else { vec![0; CHANNELS] },
            };
            Retuned { changes: vec![at(0), at(13)], record: samples[1][0].to_string(), warnings: Vec::new() }
        }
    }

    /// Keeps the output and the log.
    #[derive(Default)]
    struct Logging {
        samples: Vec<u8>,
        lines: Vec<String>,
    }

    impl Output for Logging {
        fn write(&mut self, block: Block<'_>) -> Result<(), IoError> {
            self.samples.write(block)
        }

        fn log(&mut self, line: &str) -> Result<(), IoError> {
            self.lines.push(line.to_owned());
            Ok(())
        }
    }

    fn bank() -> Bank {
        let bare = Bank::bare(SynthesisFilters::Fir(taps(0.0)), RATIO);
        Bank { delays: vec![Seconds(0.0); CHANNELS], ..bare }
    }

    fn bytes(samples: &[f64]) -> Vec<u8> {
        samples.iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    fn run(samples: &[f64], cut: usize) -> (Vec<f64>, Vec<String>) {
        run_with(samples, cut, false)
    }

    /// The output, flushed to as many frames as came in, and the log.
    fn run_with(samples: &[f64], cut: usize, is_shifting: bool) -> (Vec<f64>, Vec<String>) {
        let (bank, options) =
            (bank(), Options { precision: crate::runtime::Precision::Double, ..Options::default() });
        let plan = bank.plan(options).unwrap();
        let pipeline = Pipeline::new(&bank, &plan, Settings::plain(PcmFormat::F64Le)).unwrap();
        let mut pipeline =
            pipeline.retuned_by(&bank, options, Box::new(Changing { blocks: 0, is_shifting })).unwrap();
        let mut out = Logging::default();
        for piece in samples.chunks(cut * CHANNELS) {
            let layout = SampleLayout::packed(PcmFormat::F64Le);
            let bytes = bytes(piece);
            pipeline.push(&[PcmFrames { layout, channels: CHANNELS, bytes: &bytes }], &mut out).unwrap();
        }
        pipeline.settle(&mut out).unwrap();
        pipeline.flush((samples.len() / CHANNELS * RATIO) as u64, &mut out).unwrap();
        let values = out.samples.chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap()));
        (values.collect(), out.lines)
    }

    fn noise(frames: usize) -> Vec<f64> {
        let mut random = Random(5);
        (0..frames * CHANNELS).map(|_| random.sample()).collect()
    }

    /// The taps that hold at a frame, by the definition of the blocks.
    fn taps_at(samples: &[f64], frame: usize) -> Vec<Vec<f64>> {
        let (block, inside) = (frame / BLOCK, frame % BLOCK);
        if block < 2 {
            return taps(0.0);
        }
        let change = if inside < 13 { 0 } else { 13 };
        taps(samples[((block - 2) * BLOCK + change) * CHANNELS])
    }

    fn output(samples: &[f64], taps: &[Vec<f64>], frame: usize, p: usize) -> f64 {
        let term = |i: usize, j: usize| match frame.checked_sub(j) {
            Some(k) => taps[i].get(p + j * RATIO).copied().unwrap_or(0.0) * samples[k * CHANNELS + i],
            None => 0.0,
        };
        (0..CHANNELS).flat_map(|i| (0..5).map(move |j| (i, j))).map(|(i, j)| term(i, j)).sum()
    }

    /// Each output is that of the taps of its frame on all past samples: by the definition of the sum.
    #[test]
    fn filters_change_two_blocks_after_their_cause_with_the_history_kept() {
        let samples = noise(5 * BLOCK + 17);
        let (out, records) = run(&samples, 1000);
        for frame in 0..samples.len() / CHANNELS {
            let taps = taps_at(&samples, frame);
            for p in 0..RATIO {
                let want = output(&samples, &taps, frame, p);
                let have = out[frame * RATIO + p];
                assert!((have - want).abs() < 1e-12, "{frame} {p}: {have} {want}");
            }
        }
        let want: Vec<String> = (0..5).map(|b| samples[b * BLOCK * CHANNELS + 1].to_string()).collect();
        assert_eq!(records, want);
    }

    /// Sample n of channel i; none beyond both ends.
    fn sample(samples: &[f64], n: i64, i: usize) -> f64 {
        usize::try_from(n).ok().and_then(|n| samples.get(n * CHANNELS + i)).copied().unwrap_or(0.0)
    }

    /// Each output is that of the taps and the shifts of its frame: by the definition of the sum, over
    /// samples that lie before the shifted ones too.
    #[test]
    fn channels_are_shifted_by_whole_frames() {
        let samples = noise(6 * BLOCK + 17);
        let (out, records) = run_with(&samples, 1000, true);
        assert_eq!(out.len(), samples.len());
        let shifts_at = |frame: usize| match frame / BLOCK {
            0 | 1 => vec![0; CHANNELS],
            block => shifts(block, frame % BLOCK >= 13),
        };
        // Of a block the other thread sees the samples with the shifts of its first frame.
        let seen = |frame: usize| {
            let shift = shifts_at(frame - frame % BLOCK);
            [0, 1].map(|i| sample(&samples, frame as i64 + shift[i], i))
        };
        for frame in 0..samples.len() / CHANNELS {
            let (block, inside) = (frame / BLOCK, frame % BLOCK);
            let cause = block.checked_sub(2).map(|b| b * BLOCK + if inside < 13 { 0 } else { 13 });
            let (taps, shift) = (taps(cause.map_or(0.0, |cause| seen(cause)[0])), shifts_at(frame));
            for p in 0..RATIO {
                let term = |i: usize, j: usize| {
                    let tap = taps[i].get(p + j * RATIO).copied().unwrap_or(0.0);
                    tap * sample(&samples, frame as i64 - j as i64 + shift[i], i)
                };
                let want: f64 =
                    (0..CHANNELS).flat_map(|i| (0..5).map(move |j| (i, j))).map(|(i, j)| term(i, j)).sum();
                let have = out[frame * RATIO + p];
                assert!((have - want).abs() < 1e-12, "{frame} {p}: {have} {want}");
            }
        }
        let want: Vec<String> = (0..6).map(|b| seen(b * BLOCK)[1].to_string()).collect();
        assert_eq!(records, want);
    }

    #[test]
    fn the_cut_of_the_stream_changes_no_bit_of_shifted_channels() {
        let samples = noise(6 * BLOCK + 7);
        let whole = run_with(&samples, 10_000, true);
        for cut in [1, 7, 40, 41, 133] {
            assert_eq!(run_with(&samples, cut, true), whole, "{cut}");
        }
    }

    #[test]
    fn the_cut_of_the_stream_changes_no_bit() {
        let samples = noise(6 * BLOCK + 7);
        let whole = run(&samples, 10_000);
        for cut in [1, 7, 40, 41, 133] {
            assert_eq!(run(&samples, cut), whole, "{cut}");
        }
    }

    /// What a change adds to the output at its frame is dF times the samples that it sees.
    #[test]
    fn a_change_makes_no_click_beyond_its_size() {
        let samples = noise(4 * BLOCK);
        let (out, _) = run(&samples, 1000);
        let norm = |list: &mut dyn Iterator<Item = f64>| list.map(|x| x * x).sum::<f64>().sqrt();
        for frame in [2 * BLOCK, 2 * BLOCK + 13, 3 * BLOCK, 3 * BLOCK + 13] {
            let (old, new) = (taps_at(&samples, frame - 1), taps_at(&samples, frame));
            let seen = norm(&mut samples[(frame - 4) * CHANNELS..(frame + 1) * CHANNELS].iter().copied());
            for p in 0..RATIO {
                let kept = output(&samples, &old, frame, p);
                let phase = |taps: &[Vec<f64>]| -> Vec<f64> {
                    taps.iter().flat_map(|f| f.iter().skip(p).step_by(RATIO).copied()).collect()
                };
                let change = norm(&mut phase(&old).into_iter().zip(phase(&new)).map(|(a, b)| a - b));
                let step = (out[frame * RATIO + p] - kept).abs();
                assert!(step > 0.0 && step <= change * seen * (1.0 + 1e-12), "{step} {change} {seen}");
            }
        }
    }
}
