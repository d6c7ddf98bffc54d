//! The pipeline of a run: one real stream, or two for complex samples.

use super::complex::Imaginary;
use super::stage::RealPipeline;
use super::{Gap, GapPolicy, Outcome, Output, PipelineError, Retuner};
use crate::bank::Bank;
use crate::io::{PcmFormat, PcmFrames};
use crate::runtime::{Options, Plan, ThreadPool};
use std::sync::Arc;

/// Settings of a pipeline.
#[derive(Debug)]
pub struct Settings {
    /// Format of the numbers of the output samples.
    pub format: PcmFormat,
    /// The samples are complex: real and imaginary parts in turn, in the input and in the output. A bank is
    /// real, so it runs on both.
    pub is_complex: bool,
    /// Number of output samples that are dropped at the beginning.
    pub skip: u64,
    /// Replacement of missing samples. With `None` the runtime replaces NaN and infinity by 0.
    pub gaps: Option<GapPolicy>,
    /// Threads for filtering; `None` uses the calling thread.
    pub workers: Option<ThreadPool>,
}

impl Settings {
    /// Settings that only encode the output: real samples, no gaps, no latency skip, no threads.
    pub fn plain(format: PcmFormat) -> Self {
        Self { format, is_complex: false, skip: 0, gaps: None, workers: None }
    }
}

/// Runs a bank: fills gaps, filters, drops the latency and counts.
#[derive(Debug)]
pub struct Pipeline {
    real: RealPipeline,
    imaginary: Option<Imaginary>,
}

impl Pipeline {
    /// A new stream of `plan`, which must be the plan of `bank`.
    ///
    /// # Errors
    /// [`PipelineError::Build`] for a bank without outputs or inputs whose gaps are to be filled.
    pub fn new(bank: &Bank, plan: &Plan, settings: Settings) -> Result<Self, PipelineError> {
        let Settings { format, is_complex, skip, gaps, workers } = settings;
        let workers = workers.map(Arc::new);
        let part = || RealPipeline::new(bank, plan, format, skip, gaps, workers.clone());
        let imaginary = is_complex.then(part).transpose()?;
        let imaginary = imaginary.map(|pipeline| Imaginary::new(pipeline, gaps.is_some()));
        Ok(Self { real: part()?, imaginary })
    }

    /// The same pipeline, whose filters change as `retuner` says; `bank` and `options` are those of its
    /// plan, which adds no latency. Of complex samples the filters do not change.
    ///
    /// # Errors
    /// [`PipelineError::Thread`] if there is no thread for it.
    pub fn retuned_by(
        self,
        bank: &Bank,
        options: Options,
        retuner: Box<dyn Retuner>,
    ) -> Result<Self, PipelineError> {
        if self.imaginary.is_some() {
            return Ok(self);
        }
        Ok(Self { real: self.real.retuned_by(bank, options, retuner)?, ..self })
    }

    /// Waits for the last block that a [`Retuner`] has.
    ///
    /// # Errors
    /// [`PipelineError::Build`] for filters that do not run, or the errors of the output.
    pub fn settle(&mut self, output: &mut impl Output) -> Result<(), PipelineError> {
        self.real.settle(output)
    }

    /// What a [`Retuner`] has warned of so far.
    pub fn warnings(&self) -> &[String] {
        self.real.warnings()
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        self.real.plan()
    }

    /// Output samples so far.
    pub fn samples(&self) -> u64 {
        self.real.samples()
    }

    /// Numbers of the output that saturated so far.
    pub fn clipped(&self) -> u64 {
        self.sum(RealPipeline::clipped)
    }

    /// Numbers of the input so far that were NaN or infinite and became 0.
    pub fn replaced(&self) -> u64 {
        self.sum(RealPipeline::replaced)
    }

    fn sum(&self, count: impl Fn(&RealPipeline) -> u64) -> u64 {
        count(&self.real) + self.imaginary.as_ref().map_or(0, |imaginary| count(&imaginary.pipeline))
    }

    /// The gaps that have ended, as in [`GapFiller::gaps`](super::GapFiller::gaps).
    pub fn gaps(&self) -> &[Gap] {
        self.real.gaps()
    }

    /// The gaps that go on.
    pub fn open_gaps(&self) -> impl Iterator<Item = Gap> {
        self.real.open_gaps()
    }

    /// Processes frames. The channels are those of all `parts`, one part after another.
    ///
    /// # Errors
    /// [`PipelineError::Process`] if the channels do not match the bank, or the errors of the output.
    pub fn push(&mut self, parts: &[PcmFrames<'_>], output: &mut impl Output) -> Result<(), PipelineError> {
        match &mut self.imaginary {
            None => self.real.push(parts, output),
            Some(imaginary) => imaginary.push(&mut self.real, parts, output),
        }
    }

    /// Processes frames without a signal (zeros, once the offsets are subtracted) until `samples` samples
    /// have been written since the beginning.
    ///
    /// # Errors
    /// The errors of the output.
    pub fn flush(&mut self, samples: u64, output: &mut impl Output) -> Result<(), PipelineError> {
        match &mut self.imaginary {
            None => self.real.flush(samples, output),
            Some(imaginary) => imaginary.flush(&mut self.real, samples, output),
        }
    }

    /// Ends the open gaps and returns the outcome. Of complex samples the counts are those of both parts.
    pub fn finish(self) -> Outcome {
        let mut outcome = self.real.finish();
        if let Some(imaginary) = self.imaginary {
            let other = imaginary.pipeline.finish();
            outcome.clipped += other.clipped;
            outcome.replaced += other.replaced;
            outcome.state_resets += other.state_resets;
        }
        outcome
    }
}
