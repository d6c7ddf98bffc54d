//! Fuses a signal that is in memory, lined up with the time axis of the input.

use super::fusion::Fusion;
use super::{Outcome, PipelineError, Settings};
use crate::bank::Bank;
use crate::runtime::{
    FrameSource, Frames, Options, Plan, Planar, Precision, ProcessError, SplitOutput, ThreadPool,
};

/// Samples of a step whose frames are copied: those in which missing samples are estimated, and those
/// without a signal.
const COPIED_SAMPLES: usize = 1 << 17;

/// Output samples of a step on one thread otherwise.
const STEP_SAMPLES: usize = 1 << 18;

/// Fuses a signal in memory: M output samples for each of its frames.
///
/// With [`DroppedLatency::All`](super::DroppedLatency::All) output sample n belongs to the time of fast
/// sample n: the first samples, as many as the latency, are dropped, and as many come out at the end from
/// frames without a signal. These are the samples of `hybank fuse`, bit for bit. `plan` must be the plan of
/// `bank`. Samples are read where they are and written where they shall be; the memory used does not grow
/// with the signal.
///
/// `parts` is one input of real samples, or the real and the imaginary parts of complex ones; then
/// [`FrameSink::select`](crate::runtime::FrameSink::select) says which of them `output` stores. `stop` is
/// called several times a second, on the thread of the caller, and ends the fusion if it returns true.
///
/// # Errors
/// [`PipelineError::Process`] if the channels do not match the bank or the output is too short, and
/// [`PipelineError::Stopped`]; the output is incomplete then.
pub fn fuse(
    bank: &Bank,
    plan: &Plan,
    parts: &[&dyn FrameSource],
    output: &mut dyn SplitOutput,
    settings: Settings<'_>,
    stop: &dyn Fn() -> bool,
) -> Result<Outcome, PipelineError> {
    let (frames, ratio) = (parts.first().map_or(0, |part| part.frames()), plan.ratio());
    let wanted = frames.checked_mul(ratio).ok_or(ProcessError::TooManyFrames { frames, ratio })?;
    if parts.len() > 1 {
        output.select(0);
    }
    check(plan, parts, output.capacity(), wanted)?;
    let most = step(plan, &settings);
    let has_mask = settings.gaps.is_some();
    let mut fusion = Fusion::new(bank, plan, parts.len(), settings);
    let mut mask = Vec::new();
    let (mut first, mut written) = (0, 0);
    while first < frames {
        if stop() {
            return Err(PipelineError::Stopped);
        }
        let end = fusion.step_end(first..frames, most);
        let step: Vec<_> = parts.iter().map(|part| Frames::new(*part, first..end)).collect();
        written += after(output, written, &mut |rest| fusion.step(&step, usize::MAX, rest))?;
        mask.extend_from_slice(fusion.marks().unwrap_or_default());
        first = end;
    }
    while written < wanted {
        let missing = wanted - written;
        let frames = fusion.flush_frames(missing).min(copied_frames(plan));
        written += after(output, written, &mut |rest| fusion.flush(frames, missing, rest))?;
        mask.extend_from_slice(fusion.marks().unwrap_or_default());
    }
    let outcome = fusion.finish(wanted as u64, 0);
    Ok(Outcome { mask: has_mask.then_some(mask), ..outcome })
}

/// What `write` does with the room after the first `samples` samples.
fn after(
    output: &mut dyn SplitOutput,
    samples: usize,
    write: &mut dyn FnMut(&mut dyn SplitOutput) -> Result<usize, ProcessError>,
) -> Result<usize, ProcessError> {
    let mut written = Ok(0);
    output.halves(samples, &mut |_, rest| written = write(rest));
    written
}

/// A signal in memory in double precision, fused as by [`fuse`]: M output samples per frame. Channels that
/// are longer than the shortest one are cut.
///
/// # Errors
/// As [`fuse`], and [`PipelineError::Build`].
pub fn fused(bank: &Bank, channels: &[Vec<f64>], settings: Settings<'_>) -> Result<Vec<f64>, PipelineError> {
    let options = Options { precision: Precision::Double, ..Options::default() };
    let plan = bank.plan(options)?;
    let frames = channels.iter().map(Vec::len).min().unwrap_or(0);
    let cut: Vec<&[f64]> = channels.iter().map(|channel| &channel[..frames]).collect();
    let mut output = vec![0.0; frames * bank.ratio];
    fuse(bank, &plan, &[&Planar::new(&cut)?], &mut output.as_mut_slice(), settings, &|| false)?;
    Ok(output)
}

fn check(
    plan: &Plan,
    parts: &[&dyn FrameSource],
    capacity: usize,
    wanted: usize,
) -> Result<(), ProcessError> {
    let wrong = parts.iter().map(|part| part.channels()).find(|given| *given != plan.channels());
    if let Some(given) = wrong {
        return Err(ProcessError::Channels { given, wanted: plan.channels() });
    }
    if capacity < wanted {
        return Err(ProcessError::OutputTooShort { given: capacity, wanted });
    }
    Ok(())
}

/// Frames of a step, a multiple of the plan's alignment unless gaps are filled.
fn step(plan: &Plan, settings: &Settings<'_>) -> usize {
    let threads = settings.workers.map_or(1, ThreadPool::threads);
    match &settings.gaps {
        Some(_) => copied_frames(plan),
        None => (threads * STEP_SAMPLES / plan.ratio()).max(1).next_multiple_of(plan.alignment()),
    }
}

/// Frames of a step that are copied, at most.
fn copied_frames(plan: &Plan) -> usize {
    (COPIED_SAMPLES / plan.channels()).max(1)
}

#[cfg(test)]
mod tests;
