//! The run of a stream, through the pipeline of the command line.

use crate::errors::refused;
use crate::formats::ArrayFormat;
use hybank::bank::Bank;
use hybank::io::IoError;
use hybank::pipeline::{Block, DroppedLatency, GapEstimator, Pipeline, Settings};
use hybank::runtime::{FrameSource, Plan};
use pyo3::prelude::*;
use std::io::Write;
use std::sync::Arc;

/// A run, which the end of a `with` block closes.
pub(crate) struct Running {
    pub(crate) pipeline: Pipeline<'static>,
    /// The marks of the outputs of the last call, if missing samples are estimated.
    pub(crate) mask: Vec<u8>,
    pub(crate) is_closed: bool,
}

impl Running {
    /// A run of `bank` at its beginning.
    pub(crate) fn new(
        bank: &Bank,
        plan: &Plan,
        format: ArrayFormat,
        gaps: Option<Arc<dyn GapEstimator>>,
    ) -> Self {
        let settings = Settings { dropped: DroppedLatency::Nothing, gaps, ..Settings::default() };
        let pipeline = Pipeline::new(bank, plan, settings, format.number, format.complex);
        Self { pipeline, mask: Vec::new(), is_closed: false }
    }

    /// Filters frames into `room`, which has their size; returns how many samples came out.
    pub(crate) fn push(
        &mut self,
        parts: &[Box<dyn FrameSource + '_>],
        mut room: &mut [u8],
    ) -> PyResult<usize> {
        self.begin()?;
        let Self { pipeline, mask, .. } = self;
        let before = pipeline.samples();
        let parts: Vec<&dyn FrameSource> = parts.iter().map(|part| &**part).collect();
        pipeline.push_parts(&parts, &mut |block| keep(block, &mut room, mask)).map_err(refused)?;
        Ok((pipeline.samples() - before) as usize)
    }

    /// The last samples of a stream: those of the frames that wait for later ones, and as many frames as the
    /// latency has; returns how many.
    pub(crate) fn drain(&mut self, mut room: &mut [u8]) -> PyResult<usize> {
        self.begin()?;
        let Self { pipeline, mask, .. } = self;
        let (before, plan) = (pipeline.samples(), pipeline.plan());
        let samples = before + pipeline.pending() + (plan.flush_frames() * plan.ratio()) as u64;
        pipeline.flush(samples, &mut |block| keep(block, &mut room, mask)).map_err(refused)?;
        Ok((samples - before) as usize)
    }

    fn begin(&mut self) -> PyResult<()> {
        if self.is_closed {
            return Err(refused("the stream was closed at the end of its with block; make another one"));
        }
        self.mask.clear();
        Ok(())
    }
}

fn keep(block: Block<'_>, room: &mut &mut [u8], mask: &mut Vec<u8>) -> Result<(), IoError> {
    mask.extend_from_slice(block.mask.unwrap_or_default());
    room.write_all(block.samples).map_err(IoError::system("the array", "write the samples"))
}
