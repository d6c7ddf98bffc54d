//! Runs that fill gaps, through the pipeline of the command line.

use crate::formats::Format;
use crate::fuse::plan;
use hybank::bank::Bank;
use hybank::io::IoError;
use hybank::pipeline::{Block, Gap, Pipeline, PipelineError, Settings};
use hybank::runtime::{Algorithm, PcmFrames};
use pyo3::prelude::*;

/// A run. Its outputs are collected until they are taken.
pub(crate) struct Running {
    pub(crate) pipeline: Pipeline<'static>,
    /// Input frames.
    pub(crate) frames: u64,
    pub(crate) outputs: Outputs,
}

/// Outputs with their marks.
#[derive(Default)]
pub(crate) struct Outputs {
    pub(crate) samples: Vec<u8>,
    pub(crate) mask: Vec<u8>,
}

impl Outputs {
    fn add(&mut self, block: Block<'_>) -> Result<(), IoError> {
        self.samples.extend_from_slice(block.samples);
        self.mask.extend_from_slice(block.mask.unwrap_or_default());
        Ok(())
    }
}

impl Running {
    /// A run of `bank` at its beginning.
    pub(crate) fn new(
        bank: &Bank,
        format: Format,
        algorithm: Algorithm,
        settings: Settings<'static>,
    ) -> PyResult<Self> {
        let plan = plan(bank, format, algorithm, settings)?;
        let pipeline = Pipeline::new(bank, &plan, settings, format.number, format.complex);
        Ok(Self { pipeline, frames: 0, outputs: Outputs::default() })
    }

    pub(crate) fn push(&mut self, recordings: &[PcmFrames<'_>], frames: usize) -> Result<(), PipelineError> {
        self.frames += frames as u64;
        self.pipeline.push(recordings, &mut |block| self.outputs.add(block))
    }

    /// Frames without a signal, until so many samples were written since the beginning.
    pub(crate) fn flush(&mut self, until: u64) -> Result<(), PipelineError> {
        self.pipeline.flush(until, &mut |block| self.outputs.add(block))
    }

    /// The last samples of a stream: as many frames of them as the latency has.
    pub(crate) fn drain(&mut self) -> Result<(), PipelineError> {
        let plan = self.pipeline.plan();
        self.flush(self.pipeline.samples() + (plan.flush_frames() * plan.ratio()) as u64)
    }

    /// All gaps so far: those that have ended, then those that go on.
    pub(crate) fn gaps(&self) -> Vec<Gap> {
        self.pipeline.gaps().iter().copied().chain(self.pipeline.open_gaps()).collect()
    }
}
