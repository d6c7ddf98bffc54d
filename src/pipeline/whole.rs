//! Fuses a signal that is in memory as a whole, lined up with the time axis of the input.

use super::{GapFiller, GapPolicy, GapSummary, PipelineError};
use crate::bank::{Bank, SynthesisFilters};
use crate::runtime::{Frames, Input, Interleaved, Isa, Plan, ProcessError, SplitOutput, Stream, ThreadPool};
use std::ops::Range;

/// Samples of a step in which gaps are filled.
const STEP_SAMPLES: usize = 1 << 17;

/// Multiply-adds of a segment on one thread: from 2 ms with AVX-512 to 100 ms with double sums on a slow
/// processor.
const SEGMENT_MULTIPLY_ADDS: usize = 1 << 27;

/// Reading, converting and storing an output sample cost about as much as so many multiply-adds.
const MULTIPLY_ADDS_PER_STORE: usize = 8;

/// Settings of [`fuse`].
#[derive(Debug, Clone, Copy, Default)]
pub struct WholeSettings<'a> {
    /// Keep the latency of the bank: the causal output.
    pub keep_latency: bool,
    /// Replacement of missing samples. With `None` the runtime replaces NaN and infinity by 0.
    pub gaps: Option<GapPolicy>,
    /// Threads for filtering; `None` uses the calling thread.
    pub workers: Option<&'a ThreadPool>,
}

/// Counts of a signal that was fused.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Whole {
    /// Input samples that were NaN or infinite and became 0.
    pub replaced: u64,
    /// Times that a recursion's state was not finite and was set to zero.
    pub state_resets: u64,
    /// Missing samples, if they were to be filled.
    pub gaps: Option<GapSummary>,
    /// One byte per output sample, 1 if a missing input affects it, if gaps were to be filled.
    pub mask: Option<Vec<u8>>,
}

/// Fuses a whole signal: M output samples for each of its frames, without the latency of the bank.
///
/// Output sample n belongs to the time of fast sample n: the first samples, as many as the latency, are
/// dropped, and as many come out at the end with zeros for input. These are the samples of `hybank fuse`,
/// bit for bit. `plan` must be the plan of `bank`. Samples are read where they are and written where they
/// shall be; the memory used does not grow with the signal.
///
/// # Errors
/// [`PipelineError::Process`] if the channels do not match the bank or the output is too short.
pub fn fuse(
    bank: &Bank,
    plan: &Plan,
    input: &(impl Input + Sync + ?Sized),
    output: &mut (impl SplitOutput + ?Sized),
    settings: WholeSettings<'_>,
) -> Result<Whole, PipelineError> {
    fuse_until(bank, plan, input, output, settings, &|| false)
}

/// As [`fuse`], until `stop` returns true. It is called every few milliseconds of work, on the thread of
/// the caller.
///
/// # Errors
/// As [`fuse`], and [`PipelineError::Stopped`]; the output is incomplete then.
pub fn fuse_until(
    bank: &Bank,
    plan: &Plan,
    input: &(impl Input + Sync + ?Sized),
    output: &mut (impl SplitOutput + ?Sized),
    settings: WholeSettings<'_>,
    stop: &dyn Fn() -> bool,
) -> Result<Whole, PipelineError> {
    let (frames, ratio) = (input.frames(), plan.ratio());
    if input.channels() != plan.channels() {
        return Err(ProcessError::Channels { given: input.channels(), wanted: plan.channels() }.into());
    }
    let wanted = frames * ratio;
    if output.capacity() < wanted {
        return Err(ProcessError::OutputTooShort { given: output.capacity(), wanted }.into());
    }
    let skip = if settings.keep_latency { plan.extra_latency() } else { plan.latency() };
    let mut run = Run::new(bank, plan, skip, settings, stop)?;
    // All outputs of these frames are dropped, except a few of the last one.
    let head = skip.div_ceil(ratio).min(frames);
    let mut edge = vec![0.0; head.max(plan.flush_frames()) * ratio];
    run.frames(input, 0..head, &mut edge[..])?;
    let kept = (head * ratio).saturating_sub(skip);
    output.store(Isa::detect(), 0, &edge[head * ratio - kept..head * ratio]);
    if head < frames {
        output.halves(kept, |_, rest| run.frames(input, head..frames, rest))?;
    }
    run.flush(&mut edge)?;
    // Numbered from the beginning of the stream, the output are samples skip .. skip + wanted.
    let first = skip.saturating_sub(wanted);
    output.store(Isa::detect(), wanted + first - skip, &edge[first..skip]);
    Ok(run.finish(wanted))
}

/// A stream with its gaps.
struct Run<'a> {
    stream: Stream,
    filler: Option<GapFiller>,
    /// Marks of the bank's own outputs y\[n\].
    marks: Vec<u8>,
    /// Outputs y\[n\] that are dropped.
    dropped: usize,
    workers: Option<&'a ThreadPool>,
    /// Frames between two calls of `stop`.
    segment: usize,
    stop: &'a dyn Fn() -> bool,
}

impl<'a> Run<'a> {
    fn new(
        bank: &Bank,
        plan: &Plan,
        skip: usize,
        settings: WholeSettings<'a>,
        stop: &'a dyn Fn() -> bool,
    ) -> Result<Self, PipelineError> {
        Ok(Self {
            stream: Stream::new(plan),
            filler: settings.gaps.map(|policy| GapFiller::new(bank, policy)).transpose()?,
            marks: Vec::new(),
            dropped: skip - plan.extra_latency(),
            workers: settings.workers,
            segment: segment(bank, plan, settings.workers.map_or(1, ThreadPool::threads)),
            stop,
        })
    }

    /// Some of the frames.
    fn frames(
        &mut self,
        input: &(impl Input + Sync + ?Sized),
        frames: Range<usize>,
        output: &mut (impl SplitOutput + ?Sized),
    ) -> Result<(), PipelineError> {
        if self.filler.is_some() {
            return self.filled(input, frames, output);
        }
        let (mut first, ratio) = (frames.start, self.stream.ratio());
        while first < frames.end {
            // Segments end at multiples of their length, where no algorithm has to wait for more frames.
            let end = frames.end.min((first / self.segment + 1) * self.segment);
            let segment = Frames::new(input, first..end);
            output.halves((first - frames.start) * ratio, |_, rest| self.run(&segment, rest))?;
            first = end;
        }
        Ok(())
    }

    /// Some of the frames, gaps filled.
    fn filled(
        &mut self,
        input: &(impl Input + Sync + ?Sized),
        frames: Range<usize>,
        output: &mut (impl SplitOutput + ?Sized),
    ) -> Result<(), PipelineError> {
        let (channels, ratio) = (input.channels(), self.stream.ratio());
        let step = (STEP_SAMPLES / channels).clamp(1, self.segment);
        let mut numbers = Vec::new();
        for first in frames.clone().step_by(step) {
            let count = step.min(frames.end - first);
            numbers.resize(count * channels, 0.0);
            input.load::<f64>(Isa::detect(), first, &mut numbers);
            self.fill(&mut numbers);
            let block = Interleaved::new(&numbers, channels)?;
            output.halves((first - frames.start) * ratio, |_, rest| self.run(&block, rest))?;
        }
        Ok(())
    }

    /// Fills whole frames and appends the marks of their outputs.
    fn fill(&mut self, numbers: &mut [f64]) {
        let Some(filler) = &mut self.filler else { return };
        let mut marks = Vec::new();
        filler.fill(numbers, &mut marks);
        self.marks.append(&mut marks);
    }

    fn run(
        &mut self,
        input: &(impl Input + Sync + ?Sized),
        output: &mut (impl SplitOutput + ?Sized),
    ) -> Result<(), PipelineError> {
        if (self.stop)() {
            return Err(PipelineError::Stopped);
        }
        match self.workers {
            Some(workers) => self.stream.run_parallel(input, output, workers),
            None => self.stream.run(input, output),
        }?;
        Ok(())
    }

    /// The last samples.
    fn flush(&mut self, output: &mut [f64]) -> Result<(), ProcessError> {
        let zeros = self.dropped.div_ceil(self.stream.ratio()) * self.stream.channels();
        self.fill(&mut vec![0.0; zeros]);
        self.stream.flush(output)?;
        Ok(())
    }

    fn finish(mut self, samples: usize) -> Whole {
        let gaps = self.filler.as_mut().map(|filler| {
            filler.finish();
            GapSummary { count: filler.total(), missing: filler.missing(), list: filler.gaps().to_vec() }
        });
        let mask = gaps.is_some().then(|| {
            self.marks.drain(..self.dropped);
            self.marks.truncate(samples);
            self.marks
        });
        let (replaced, state_resets) = (self.stream.replaced(), self.stream.state_resets());
        Whole { replaced, state_resets, gaps, mask }
    }
}

/// Frames of a segment, a multiple of the plan's alignment.
fn segment(bank: &Bank, plan: &Plan, threads: usize) -> usize {
    let each = multiply_adds_per_frame(bank, plan) + plan.ratio() * MULTIPLY_ADDS_PER_STORE;
    (threads * SEGMENT_MULTIPLY_ADDS / each).max(1).next_multiple_of(plan.alignment())
}

/// Multiply-adds of a frame, at most.
fn multiply_adds_per_frame(bank: &Bank, plan: &Plan) -> usize {
    let (channels, ratio) = (plan.channels(), plan.ratio());
    match (&bank.filters, plan.summary().multiply_adds) {
        (SynthesisFilters::StateSpace(system), None) => {
            (system.a.len() + ratio) * (system.a.len() + channels)
        }
        (_, each) => each.unwrap_or_default().ceil() as usize * ratio,
    }
}

#[cfg(test)]
mod tests;
