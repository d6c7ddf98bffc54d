//! Runs all frames of a reader through a pipeline.

use super::{Output, Pipeline, PipelineError};
use crate::io::{Arrival, MultiReader, PcmFrames};

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The inputs ended.
    Inputs,
    /// A message came on the reader's stop channel. All frames read so far have been processed.
    Stopped,
}

/// Runs until the inputs end or a stop is requested. Each step calls `observe` with its frames and the
/// pipeline, once they are processed. This function does not flush.
///
/// # Errors
/// [`PipelineError`] for an input that cannot be read, frames that do not fit the bank, or an output that
/// cannot be written.
pub fn run(
    reader: &mut MultiReader,
    pipeline: &mut Pipeline,
    output: &mut impl Output,
    mut observe: impl FnMut(&[PcmFrames<'_>], &Pipeline),
) -> Result<Ending, PipelineError> {
    loop {
        match reader.wait()? {
            Arrival::Frames(frames) => {
                let parts = reader.frames();
                pipeline.push(&parts, output)?;
                observe(&parts, pipeline);
                drop(parts);
                reader.consume(frames);
            }
            Arrival::End => return Ok(Ending::Inputs),
            Arrival::Stopped => return Ok(Ending::Stopped),
        }
    }
}
