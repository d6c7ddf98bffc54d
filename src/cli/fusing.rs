//! A run under way: ticks through gaps and filters into the output.

use super::Failure;
use super::gaps::{GapReport, GapStage};
use super::output::FastWriter;
use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use crate::runtime::{Form, PcmOutput, PlanSummary, Stream, Workers};

/// Encoded output of one step at most.
const STEP_BYTES: usize = 256 << 10;
/// Ticks of zeros that flush at a time.
const FLUSH_TICKS: usize = 256;

/// In which form FIR filters run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum FormArg {
    /// What suits the verb
    Auto,
    /// Every product; no later than the bank's latency
    Direct,
    /// Ticks by twos, three products for four; up to a quarter faster for long filters, and no later
    Fast,
    /// Fourier transforms of blocks; faster for long filters, but later
    OverlapSave,
}

impl FormArg {
    /// `auto` is what leaving the choice to the verb means.
    pub(super) fn form(self, auto: Form) -> Form {
        match self {
            Self::Auto => auto,
            Self::Direct => Form::Direct,
            Self::Fast => Form::Fast,
            Self::OverlapSave => Form::OverlapSave(None),
        }
    }
}

/// Threads of the filters.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct ThreadArgs {
    /// Threads that filter (FIR banks only), 0 for one a processor. The result has the same bits with any number. More than one
    /// pays with many taps or channels; otherwise reading and writing take longer than filtering
    #[arg(long, value_name = "T", default_value_t = 1, value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
}

impl ThreadArgs {
    /// `None` if the calling thread does all.
    pub(super) fn workers(self) -> Result<Option<Workers>, Failure> {
        if self.threads == 1 {
            return Ok(None);
        }
        let workers = Workers::new(self.threads.into());
        let told = |error| Failure::Input(format!("--threads {}: {error}; ask for fewer", self.threads));
        workers.map(Some).map_err(told)
    }

    /// Bytes of each input that are read, and of output that are made, at a time, for `bytes` with one thread: enough
    /// for all threads.
    pub(super) fn bytes(self, bytes: usize) -> usize {
        if self.threads == 1 { bytes } else { 8 * bytes }
    }
}

/// What a run carries from block to block.
pub(super) struct Fusing {
    pub(super) stream: Stream,
    pub(super) gaps: Option<GapStage>,
    pub(super) writer: FastWriter,
    workers: Option<Workers>,
    step_bytes: usize,
    /// Output samples still to be dropped.
    pub(super) skip: u64,
    clipped: u64,
    buffer: Vec<u8>,
}

/// How the bank ran.
#[derive(Debug, serde::Serialize)]
struct PlanReport {
    form: &'static str,
    numbers: &'static str,
    isa: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    transform: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    block: Option<usize>,
    extra_latency: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    multiply_adds: Option<f64>,
}

impl From<PlanSummary> for PlanReport {
    fn from(plan: PlanSummary) -> Self {
        let PlanSummary { form, numbers, isa, transform, block, extra_latency, multiply_adds } = plan;
        Self { form, numbers, isa, transform, block, extra_latency, multiply_adds }
    }
}

/// What every verb that fuses reports.
#[derive(Debug, serde::Serialize)]
pub(super) struct RunReport {
    /// How the bank ran.
    plan: PlanReport,
    channels: usize,
    ratio: usize,
    /// Fast samples written.
    pub(super) samples: u64,
    /// Output samples that saturated.
    clipped: u64,
    /// Input samples that were NaN or infinite and became 0.
    replaced: u64,
    /// Times that a recursion's state was not finite and began anew.
    state_resets: u64,
    /// Missing samples, if --gaps asked for them.
    #[serde(skip_serializing_if = "Option::is_none")]
    gaps: Option<GapReport>,
    pub(super) warnings: Vec<String>,
}

impl Fusing {
    /// Drops the first `skip` output samples.
    pub(super) fn new(
        stream: Stream,
        gaps: Option<GapStage>,
        writer: FastWriter,
        skip: u64,
        threads: ThreadArgs,
    ) -> Result<Self, Failure> {
        let (workers, step_bytes) = (threads.workers()?, threads.bytes(STEP_BYTES));
        Ok(Self { stream, gaps, writer, workers, step_bytes, skip, clipped: 0, buffer: Vec::new() })
    }

    /// Fuses ticks and writes what is not to be dropped, at most `limit` samples.
    pub(super) fn fuse(&mut self, frames: &[PcmFrames<'_>], limit: u64) -> Result<(), Failure> {
        let ticks = frames.iter().map(PcmFrames::frames).min().unwrap_or(0);
        let step = (self.step_bytes / self.stream.ratio() / self.writer.format().bytes()).max(1);
        let mut limit = limit;
        for first in (0..ticks).step_by(step) {
            let count = step.min(ticks - first);
            let some: Vec<_> = frames.iter().map(|part| part.range(first..first + count)).collect();
            limit -= self.step(&some, limit)?;
        }
        Ok(())
    }

    /// One step; returns the samples written.
    fn step(&mut self, frames: &[PcmFrames<'_>], limit: u64) -> Result<u64, Failure> {
        let format = self.writer.format();
        let ticks = frames.iter().map(PcmFrames::frames).min().unwrap_or(0);
        self.buffer.resize(ticks * self.stream.ratio() * format.bytes(), 0);
        let mut output = PcmOutput { format, bytes: &mut self.buffer, clipped: 0 };
        let filled = self.gaps.as_mut().map(|stage| stage.fill(frames));
        let frames = filled.as_deref().unwrap_or(frames);
        let samples = match &self.workers {
            Some(workers) => self.stream.process_pcm_parallel(frames, &mut output, workers),
            None => self.stream.process_pcm(frames, &mut output),
        };
        let samples = samples.map_err(Failure::input)? as u64;
        self.clipped += output.clipped;
        let skip = self.skip.min(samples);
        self.skip -= skip;
        let end = samples.min(skip.saturating_add(limit));
        let range = skip as usize..end as usize;
        if let Some(stage) = &mut self.gaps {
            stage.write_mask(range.clone())?;
        }
        self.writer.write(&self.buffer[range.start * format.bytes()..range.end * format.bytes()])?;
        Ok(end - skip)
    }

    /// Zeros until `samples` samples are written.
    pub(super) fn flush(&mut self, samples: u64) -> Result<(), Failure> {
        let layout = SampleLayout::packed(PcmFormat::F32Le);
        let (channels, ratio) = (self.stream.channels(), self.stream.ratio() as u64);
        let zeros = vec![0; FLUSH_TICKS * channels * 4];
        while self.writer.samples() < samples {
            let missing = samples - self.writer.samples();
            let ticks = (missing + self.skip).div_ceil(ratio).min(FLUSH_TICKS as u64) as usize;
            self.fuse(&[PcmFrames { layout, channels, bytes: &zeros[..ticks * channels * 4] }], missing)?;
        }
        Ok(())
    }

    /// What happened; `notes` are the faults of the inputs, and `lossless` is the option that would have kept
    /// clipped samples. Gaps are also told on standard error.
    pub(super) fn report(&mut self, notes: Vec<String>, lossless: &str) -> RunReport {
        RunReport {
            plan: self.stream.plan().summary().into(),
            channels: self.stream.channels(),
            ratio: self.stream.ratio(),
            samples: self.writer.samples(),
            clipped: self.clipped,
            replaced: self.stream.replaced(),
            state_resets: self.stream.state_resets(),
            gaps: self.gaps.as_mut().map(GapStage::report),
            warnings: notes.into_iter().chain(self.tolerated(lossless)).collect(),
        }
    }

    /// What the filters had to tolerate, in words.
    fn tolerated(&self, lossless: &str) -> impl Iterator<Item = String> {
        [
            (self.stream.replaced(), "input samples were NaN or infinite and were replaced by 0".to_owned()),
            (self.clipped, format!("output samples were clipped; {lossless} keeps them")),
            (self.stream.state_resets(), "times the filter state was not finite and began anew".to_owned()),
        ]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
    }

    /// Gives the outputs their names.
    pub(super) fn finish(self) -> Result<(), Failure> {
        self.writer.finish()?;
        self.gaps.map_or(Ok(()), GapStage::close)
    }
}

impl RunReport {
    /// Tells the warnings, or makes the first of them an error.
    pub(super) fn judge(&self, strict: bool) -> Result<(), Failure> {
        if let (true, Some(first)) = (strict, self.warnings.first()) {
            return Err(Failure::Input(format!("{first} (an error because of --strict)")));
        }
        self.warnings.iter().for_each(|warning| eprintln!("hybank: warning: {warning}"));
        Ok(())
    }
}
