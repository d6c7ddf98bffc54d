//! A bank that runs on frames as they arrive.

use super::fusion::Fusion;
use super::{Gap, Outcome, PipelineError, Settings};
use crate::bank::Bank;
use crate::io::{IoError, NumberFrames, PcmFormat, RecordedFrames};
use crate::runtime::{FrameSource, Frames, PcmOutput, Plan, SideBySide};

/// Maximum size of the encoded output of one step for one thread: a share of the second-level cache.
const STEP_BYTES: usize = 256 << 10;
/// Steps of several threads are so many times as long, enough for the chunks of all.
const PARALLEL_STEPS: usize = 8;

/// Output samples with their mask.
#[derive(Debug, Clone, Copy)]
pub struct Block<'a> {
    /// Encoded samples.
    pub samples: &'a [u8],
    /// One byte per sample: 0 if no missing input affects it, else its predicted signal-to-noise ratio in
    /// decibels, from 1 to 255; `None` if missing samples are not estimated.
    pub mask: Option<&'a [u8]>,
}

/// Takes the outputs of a [`Pipeline`].
type Write<'w> = &'w mut dyn FnMut(Block<'_>) -> Result<(), IoError>;

/// Runs a bank on frames as they arrive: estimates missing samples, filters, drops the latency, encodes and
/// counts.
#[derive(Debug)]
pub struct Pipeline<'a> {
    pub(super) fusion: Fusion<'a>,
    format: PcmFormat,
    /// Frames of a step, at most.
    step: usize,
    samples: u64,
    pub(super) clipped: u64,
    peak: f64,
    buffer: Vec<u8>,
}

impl<'a> Pipeline<'a> {
    /// A new signal through `plan`, which must be the plan of `bank`. Outputs have numbers of `format`. If
    /// the samples are complex, real and imaginary parts take turns in the input and in the output; a bank
    /// is real, so it runs on both.
    pub fn new(
        bank: &Bank,
        plan: &Plan,
        settings: Settings<'a>,
        format: PcmFormat,
        is_complex: bool,
    ) -> Self {
        let steps = if settings.workers.is_some() { PARALLEL_STEPS } else { 1 };
        let fusion = Fusion::new(bank, plan, 1 + usize::from(is_complex), settings);
        let step = (steps * STEP_BYTES / plan.ratio() / format.bytes()).max(1);
        Self { fusion, format, step, samples: 0, clipped: 0, peak: 0.0, buffer: Vec::new() }
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        self.fusion.stream().plan()
    }

    /// Frames so far, with those that a flush adds.
    pub fn position(&self) -> u64 {
        self.fusion.stream().position()
    }

    /// Output samples so far.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Output samples of the frames so far that wait for later frames, from which missing samples may
    /// have to be estimated; a flush brings them out.
    pub fn pending(&self) -> u64 {
        self.fusion.pending() as u64
    }

    /// Numbers of the output that saturated so far.
    pub fn clipped(&self) -> u64 {
        self.clipped
    }

    /// The largest magnitude of the output so far, of full scale, before it saturates.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Numbers of the input so far that were NaN or infinite and became 0.
    pub fn replaced(&self) -> u64 {
        self.fusion.replaced()
    }

    /// Times so far that the state of a recursion was not finite and became 0.
    pub fn state_resets(&self) -> u64 {
        self.fusion.state_resets()
    }

    /// The gaps that have ended, in the order of their ends, at most [`LISTED_GAPS`](super::LISTED_GAPS).
    pub fn gaps(&self) -> &[Gap] {
        self.fusion.gaps()
    }

    /// The gaps that go on.
    pub fn open_gaps(&self) -> impl Iterator<Item = Gap> {
        self.fusion.open_gaps()
    }

    /// Processes frames. The channels are those of all `recordings`, one after another.
    ///
    /// # Errors
    /// [`PipelineError::Process`] if the channels do not match the bank, and the errors of `write`.
    pub fn push(&mut self, recordings: &[RecordedFrames<'_>], write: Write<'_>) -> Result<(), PipelineError> {
        let real: Vec<NumberFrames<'_>> = recordings.iter().map(|recording| recording.real).collect();
        if self.fusion.parts() == 1 {
            return self.push_parts(&[&SideBySide::new(real)], write);
        }
        let imaginary: Vec<_> = recordings.iter().filter_map(|recording| recording.imaginary).collect();
        self.push_parts(&[&SideBySide::new(real), &SideBySide::new(imaginary)], write)
    }

    /// Processes frames without a signal (zeros, once the offsets are subtracted) until `samples` samples
    /// have been written since the beginning.
    ///
    /// # Errors
    /// The errors of the output.
    pub fn flush(&mut self, samples: u64, write: Write<'_>) -> Result<(), PipelineError> {
        while self.samples < samples {
            let most = usize::try_from(samples - self.samples).unwrap_or(usize::MAX);
            let frames = self.fusion.flush_frames(most).min(self.step);
            let mut output = room(&mut self.buffer, self.format, frames * self.fusion.outputs());
            let written = self.fusion.flush(frames, most, &mut output)?;
            self.clipped += output.clipped;
            self.peak = self.peak.max(output.peak(written * self.fusion.parts()));
            self.written(written, write)?;
        }
        Ok(())
    }

    /// Ends the open gaps and returns the outcome. Of complex samples the counts are those of both parts.
    pub fn finish(self) -> Outcome {
        self.fusion.finish(self.samples, self.clipped)
    }

    /// As [`Pipeline::push`], of the real samples, or of the real and the imaginary parts of complex ones.
    ///
    /// # Errors
    /// As [`Pipeline::push`].
    pub fn push_parts(&mut self, parts: &[&dyn FrameSource], write: Write<'_>) -> Result<(), PipelineError> {
        let frames = parts.first().map_or(0, |part| part.frames());
        let mut first = 0;
        while first < frames {
            let end = self.fusion.step_end(first..frames, self.step);
            let step: Vec<_> = parts.iter().map(|part| Frames::new(*part, first..end)).collect();
            self.step(&step, write)?;
            first = end;
        }
        Ok(())
    }

    fn step(&mut self, parts: &[impl FrameSource], write: Write<'_>) -> Result<(), PipelineError> {
        let frames = parts.first().map_or(0, FrameSource::frames);
        let mut output = room(&mut self.buffer, self.format, frames * self.fusion.outputs());
        let written = self.fusion.step(parts, usize::MAX, &mut output)?;
        self.clipped += output.clipped;
        self.peak = self.peak.max(output.peak(written * self.fusion.parts()));
        self.written(written, write)
    }

    /// Hands over the samples of a step.
    fn written(&mut self, samples: usize, write: Write<'_>) -> Result<(), PipelineError> {
        self.samples += samples as u64;
        let size = self.format.bytes() * self.fusion.parts();
        Ok(write(Block { samples: &self.buffer[..samples * size], mask: self.fusion.marks() })?)
    }
}

/// Room for so many numbers.
fn room(buffer: &mut Vec<u8>, format: PcmFormat, numbers: usize) -> PcmOutput<'_> {
    let bytes = numbers * format.bytes();
    // It only grows: what is in it is overwritten.
    if buffer.len() < bytes {
        buffer.resize(bytes, 0);
    }
    PcmOutput::packed(format, &mut buffer[..bytes])
}

#[cfg(test)]
mod tests;
