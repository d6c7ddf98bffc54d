//! The one loop of all runs: estimates missing samples, filters, drops the latency and keeps the marks
//! aligned.

use super::gaps::{GapEstimator, GapFiller};
use super::{Gap, Outcome};
use crate::bank::Bank;
use crate::runtime::{
    FrameSink, FrameSource, Interleaved, Isa, Plan, ProcessError, SplitOutput, Stream, ThreadPool,
};
use std::ops::Range;
use std::sync::Arc;

/// Settings of a run.
#[derive(Debug, Clone, Default)]
pub struct Settings<'a> {
    /// The output samples that are dropped at the beginning.
    pub dropped: DroppedLatency,
    /// What estimates missing samples. With `None` the runtime replaces NaN and infinity by 0.
    pub gaps: Option<Arc<dyn GapEstimator>>,
    /// Threads for filtering; `None` uses the calling thread.
    pub workers: Option<&'a ThreadPool>,
}

/// The part of the latency that is dropped at the beginning of the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DroppedLatency {
    /// All of it: the output lines up with the time axis of the input.
    #[default]
    All,
    /// What the algorithm adds: the output is late by the latency of the bank.
    Added,
    /// Nothing.
    Nothing,
}

impl DroppedLatency {
    /// Output samples of `plan`.
    pub fn samples(self, plan: &Plan) -> usize {
        match self {
            Self::All => plan.latency(),
            Self::Added => plan.extra_latency(),
            Self::Nothing => 0,
        }
    }
}

/// Streams of one signal: one of real samples, two of the parts of complex ones, with their gaps.
#[derive(Debug)]
pub(super) struct Fusion<'a> {
    streams: Vec<Stream>,
    gaps: Option<GapFiller>,
    workers: Option<&'a ThreadPool>,
    /// Output samples still to be dropped.
    skip: usize,
    /// The outputs of the last step that were not dropped.
    kept: Range<usize>,
    offsets: Vec<f64>,
}

impl<'a> Fusion<'a> {
    /// A new signal of so many parts through `plan`, which must be the plan of `bank`.
    pub(super) fn new(bank: &Bank, plan: &Plan, parts: usize, settings: Settings<'a>) -> Self {
        let filler = |estimator| GapFiller::new(bank, plan, parts, estimator);
        Self {
            streams: vec![Stream::new(plan); parts],
            gaps: settings.gaps.map(filler),
            workers: settings.workers,
            skip: settings.dropped.samples(plan),
            kept: 0..0,
            offsets: bank.layout().each(&bank.offsets),
        }
    }

    /// The stream of the real parts.
    pub(super) fn stream(&self) -> &Stream {
        &self.streams[0]
    }

    /// One stream, or those of the real and the imaginary parts.
    pub(super) fn streams(&self) -> &[Stream] {
        &self.streams
    }

    /// Goes on with other streams of the same plan.
    pub(super) fn set_streams(&mut self, streams: Vec<Stream>) {
        self.streams = streams;
    }

    /// 1, or 2 for complex samples.
    pub(super) fn parts(&self) -> usize {
        self.streams.len()
    }

    /// Numbers of the output per frame.
    pub(super) fn outputs(&self) -> usize {
        self.stream().ratio() * self.parts()
    }

    /// Numbers of the input so far that were NaN or infinite and became 0.
    pub(super) fn replaced(&self) -> u64 {
        self.streams.iter().map(Stream::replaced).sum::<u64>()
    }

    /// Times that the state of a recursion was not finite and became 0.
    pub(super) fn state_resets(&self) -> u64 {
        self.streams.iter().map(Stream::state_resets).sum()
    }

    /// The gaps that have ended.
    pub(super) fn gaps(&self) -> &[Gap] {
        self.gaps.as_ref().map_or(&[], |filler| &filler.summary().list)
    }

    /// The gaps that go on.
    pub(super) fn open_gaps(&self) -> impl Iterator<Item = Gap> {
        self.gaps.iter().flat_map(GapFiller::open)
    }

    /// Where the step that begins with the first of these frames ends: it has at most `most` frames.
    pub(super) fn step_end(&self, frames: Range<usize>, most: usize) -> usize {
        let position = (self.stream().position() % most as u64) as usize;
        let count = match self.skip {
            // Steps end at multiples of their length, where no algorithm has to wait for more frames.
            0 => most - position,
            // Outputs that are dropped take a detour: they have a step of their own.
            skip => skip.div_ceil(self.stream().ratio()).min(most),
        };
        frames.end.min(frames.start + count)
    }

    /// Filters frames of all `parts`. Of the outputs that are not dropped, at most the first `most` go to
    /// `output`; returns how many.
    pub(super) fn step(
        &mut self,
        parts: &[impl FrameSource],
        most: usize,
        output: &mut dyn SplitOutput,
    ) -> Result<usize, ProcessError> {
        let frames = parts.first().map_or(0, FrameSource::frames);
        match &mut self.gaps {
            None => self.filter(parts, frames, most, output),
            Some(gaps) => {
                let wanted = self.streams[0].channels();
                if let Some(given) = parts.iter().map(FrameSource::channels).find(|given| *given != wanted) {
                    return Err(ProcessError::Channels { given, wanted });
                }
                let frames = gaps.fill(parts);
                self.filter_filled(frames, most, output)
            }
        }
    }

    /// Filters the frames that come out of the gap filler.
    fn filter_filled(
        &mut self,
        frames: usize,
        most: usize,
        output: &mut dyn SplitOutput,
    ) -> Result<usize, ProcessError> {
        // Its frames are read while the streams change.
        let Some(gaps) = self.gaps.take() else { return Ok(0) };
        let filled = |part| Interleaved::new(gaps.filled(part), self.offsets.len());
        let filled: Result<Vec<_>, _> = (0..self.parts()).map(filled).collect();
        let written = filled.and_then(|parts| self.filter(&parts, frames, most, output));
        self.gaps = Some(gaps);
        written
    }

    fn filter(
        &mut self,
        parts: &[impl FrameSource],
        frames: usize,
        most: usize,
        output: &mut dyn SplitOutput,
    ) -> Result<usize, ProcessError> {
        let samples = frames * self.stream().ratio();
        let dropped = self.skip.min(samples);
        self.kept = dropped..samples.min(dropped.saturating_add(most));
        for (p, part) in parts.iter().enumerate() {
            if parts.len() > 1 {
                output.select(p);
            }
            let kept = (self.kept != (0..samples)).then(|| self.kept.clone());
            run(&mut self.streams[p], part, kept, output, self.workers)?;
        }
        self.skip -= dropped;
        Ok(self.kept.len())
    }

    /// Output samples of the frames so far that wait for later frames, from which missing samples may have
    /// to be estimated.
    pub(super) fn pending(&self) -> usize {
        let held = self.gaps.as_ref().map_or(0, GapFiller::held);
        (held * self.stream().ratio()).saturating_sub(self.skip)
    }

    /// Frames without a signal that bring out `count` more samples.
    pub(super) fn flush_frames(&self, count: usize) -> usize {
        let held = self.gaps.as_ref().map_or(0, GapFiller::held);
        self.skip.saturating_add(count).div_ceil(self.stream().ratio()).saturating_add(held)
    }

    /// As [`Fusion::step`], with frames without a signal.
    pub(super) fn flush(
        &mut self,
        frames: usize,
        most: usize,
        output: &mut dyn SplitOutput,
    ) -> Result<usize, ProcessError> {
        if let Some(gaps) = &mut self.gaps {
            let frames = gaps.fill_after_end(frames);
            return self.filter_filled(frames, most, output);
        }
        // The offsets of the converters, which are 0 once they are subtracted.
        let silence = self.offsets.repeat(frames);
        let part = Interleaved::new(&silence, self.offsets.len())?;
        self.step(&vec![part; self.parts()], most, output)
    }

    /// The marks of the outputs of the last step, if missing samples are estimated.
    pub(super) fn marks(&self) -> Option<&[u8]> {
        self.gaps.as_ref().map(|gaps| gaps.marks(self.kept.clone()))
    }

    /// Ends the open gaps; `samples` of the outputs were written, and `clipped` of them saturated.
    pub(super) fn finish(self, samples: u64, clipped: u64) -> Outcome {
        let stream = self.stream();
        Outcome {
            plan: stream.plan().summary(),
            channels: stream.channels(),
            ratio: stream.ratio(),
            samples,
            clipped,
            replaced: self.replaced(),
            state_resets: self.state_resets(),
            gaps: self.gaps.map(GapFiller::finish),
            mask: None,
        }
    }
}

/// Filters frames; of their outputs only those in `kept` are stored, if not all are.
fn run(
    stream: &mut Stream,
    input: &dyn FrameSource,
    kept: Option<Range<usize>>,
    output: &mut dyn SplitOutput,
    workers: Option<&ThreadPool>,
) -> Result<usize, ProcessError> {
    match (kept, workers) {
        (Some(range), _) => stream.run(input, &mut Kept { output, range }),
        (None, Some(workers)) => stream.run_parallel(input, output, workers),
        (None, None) => stream.run(input, output),
    }
}

/// Room for some of the outputs of a call; the others are dropped before they are encoded.
struct Kept<'a> {
    output: &'a mut dyn FrameSink,
    range: Range<usize>,
}

impl Kept<'_> {
    /// Where the output takes samples of `count` from sample `first` on, and which of them.
    fn kept(&self, first: usize, count: usize) -> Option<(usize, Range<usize>)> {
        let (begin, end) = (self.range.start.max(first), self.range.end.min(first + count));
        (begin < end).then(|| (begin - self.range.start, begin - first..end - first))
    }
}

impl FrameSink for Kept<'_> {
    fn capacity(&self) -> usize {
        usize::MAX
    }

    fn store_f32(&mut self, isa: Isa, first: usize, samples: &[f32]) {
        if let Some((place, kept)) = self.kept(first, samples.len()) {
            self.output.store_f32(isa, place, &samples[kept]);
        }
    }

    fn store_f64(&mut self, isa: Isa, first: usize, samples: &[f64]) {
        if let Some((place, kept)) = self.kept(first, samples.len()) {
            self.output.store_f64(isa, place, &samples[kept]);
        }
    }
}
