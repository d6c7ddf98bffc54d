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

use super::{Output, PipelineError};
use crate::bank::{Bank, SynthesisFilters};
use crate::io::PcmFrames;
use crate::runtime::{BuildError, Options, Stream};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::Builder;

/// Says how the filters of a running pipeline change.
pub trait Retuner: Send {
    /// Frames of a block.
    fn block_frames(&self) -> usize;

    /// Takes the samples of the next block, one list per channel as they came in, and says what changes two
    /// blocks later.
    fn retune(&mut self, samples: &[Vec<f64>]) -> Retuned;
}

/// What a block changes.
#[derive(Debug, Clone, Default)]
pub struct Retuned {
    /// Filters with the frame of the block, from 0, from which on they hold, in ascending order.
    pub changes: Vec<(usize, SynthesisFilters)>,
    /// A line for a log; empty for none.
    pub record: String,
    /// What a user should know at once.
    pub warnings: Vec<String>,
}

/// A [`Retuned`] whose filters are ready to run.
struct Ready {
    changes: Vec<(usize, Stream)>,
    record: String,
    warnings: Vec<String>,
}

/// The changes of one pipeline.
#[derive(Debug)]
pub(super) struct Tuning {
    block: usize,
    /// The frames of the present block.
    samples: Vec<Vec<f64>>,
    jobs: Sender<Vec<Vec<f64>>>,
    results: Receiver<Result<Ready, BuildError>>,
    /// The other thread has a block.
    is_waiting: bool,
    /// Frames so far.
    position: u64,
    /// Frame and stream of changes to come.
    changes: VecDeque<(u64, Stream)>,
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
        let (block, channels) = (retuner.block_frames().max(1), bank.channel_count());
        let (jobs, blocks) = channel::<Vec<Vec<f64>>>();
        let (ready, results) = channel();
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
            samples: vec![Vec::with_capacity(block); channels],
            jobs,
            results,
            is_waiting: false,
            position: 0,
            changes: VecDeque::new(),
            records: Vec::new(),
            warnings: Vec::new(),
        })
    }

    /// Frames until the next change or the end of the block; at least one.
    pub(super) fn frames_ahead(&self) -> usize {
        let gathered = self.samples.first().map_or(0, Vec::len);
        let to_change = self.changes.front().map_or(u64::MAX, |(frame, _)| frame - self.position);
        (self.block - gathered).min(usize::try_from(to_change).unwrap_or(usize::MAX))
    }

    /// Takes frames that were processed, at most [`Tuning::frames_ahead`], and returns the stream that goes
    /// on from here if the filters change.
    ///
    /// # Errors
    /// [`PipelineError::Build`] for filters that do not run.
    pub(super) fn passed(&mut self, parts: &[PcmFrames<'_>]) -> Result<Option<Stream>, PipelineError> {
        let before = self.samples.first().map_or(0, Vec::len);
        let mut channels = self.samples.iter_mut();
        for part in parts {
            for (c, samples) in channels.by_ref().take(part.channels).enumerate() {
                let (format, container) = (part.layout.format, part.layout.container);
                let frames = part.bytes.chunks_exact(part.frame_bytes());
                samples.extend(frames.map(|frame| format.decode(&frame[c * container..])));
            }
        }
        let gathered = self.samples.first().map_or(0, Vec::len);
        self.position += (gathered - before) as u64;
        if gathered == self.block {
            self.end_block()?;
        }
        let is_due = self.changes.front().is_some_and(|(frame, _)| *frame == self.position);
        Ok(is_due.then(|| self.changes.pop_front()).flatten().map(|(_, stream)| stream))
    }

    /// Hands the block over, once the changes of the one before are known.
    fn end_block(&mut self) -> Result<(), PipelineError> {
        self.receive()?;
        let next = vec![Vec::with_capacity(self.block); self.samples.len()];
        let block = std::mem::replace(&mut self.samples, next);
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

    /// Waits for the changes of the block that the other thread has; they hold from the present frame on.
    pub(super) fn receive(&mut self) -> Result<(), PipelineError> {
        if !std::mem::take(&mut self.is_waiting) {
            return Ok(());
        }
        // A thread that is gone changes nothing any more.
        let Ok(found) = self.results.recv() else { return Ok(()) };
        let Ready { changes, record, warnings } = found?;
        self.changes = changes
            .into_iter()
            .filter(|(frame, _)| *frame < self.block)
            .map(|(frame, stream)| (self.position + frame as u64, stream))
            .collect();
        self.records.extend(Some(record).filter(|record| !record.is_empty()));
        self.warnings.extend(warnings);
        Ok(())
    }
}

fn prepared(bank: &mut Bank, options: Options, found: Retuned) -> Result<Ready, BuildError> {
    let Retuned { changes, record, warnings } = found;
    let mut streams = Vec::with_capacity(changes.len());
    for (frame, filters) in changes {
        bank.filters = filters;
        streams.push((frame, Stream::new(&bank.plan(options)?)));
    }
    Ok(Ready { changes: streams, record, warnings })
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
    /// last.
    struct Changing;

    fn taps(seed: f64) -> Vec<Vec<f64>> {
        (0..CHANNELS).map(|i| (0..9).map(|n| (seed + (3 * n + 5 * i) as f64).sin()).collect()).collect()
    }

    impl Retuner for Changing {
        fn block_frames(&self) -> usize {
            BLOCK
        }

        fn retune(&mut self, samples: &[Vec<f64>]) -> Retuned {
            assert!(samples.iter().all(|list| list.len() == BLOCK));
            let at = |frame: usize| (frame, SynthesisFilters::Fir(taps(samples[0][frame])));
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
        let (bank, options) =
            (bank(), Options { precision: crate::runtime::Precision::Double, ..Options::default() });
        let plan = bank.plan(options).unwrap();
        let pipeline = Pipeline::new(&bank, &plan, Settings::plain(PcmFormat::F64Le)).unwrap();
        let mut pipeline = pipeline.retuned_by(&bank, options, Box::new(Changing)).unwrap();
        let mut out = Logging::default();
        for piece in samples.chunks(cut * CHANNELS) {
            let layout = SampleLayout::packed(PcmFormat::F64Le);
            let bytes = bytes(piece);
            pipeline.push(&[PcmFrames { layout, channels: CHANNELS, bytes: &bytes }], &mut out).unwrap();
        }
        pipeline.settle(&mut out).unwrap();
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
