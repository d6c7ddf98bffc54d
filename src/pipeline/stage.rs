//! The stages of a pipeline: gap filling, filtering and encoding.

use super::mask::MaskDelay;
use super::retune::{Retuner, Tuning};
use super::{Block, Gap, GapFiller, GapPolicy, GapSummary, Outcome, Output, PipelineError};
use crate::bank::Bank;
use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use crate::runtime::{Options, PcmOutput, Plan, ProcessError, Stream, ThreadPool};
use std::ops::Range;
use std::sync::Arc;

/// Maximum size of the encoded output of one step, for one thread.
const STEP_BYTES: usize = 256 << 10;
/// Number of zero frames per step of a flush.
const FLUSH_FRAMES: usize = 256;

/// Runs one stream: fills gaps, filters, drops the latency and counts.
#[derive(Debug)]
pub(super) struct RealPipeline {
    stream: Stream,
    gaps: Option<(GapFiller, MaskDelay)>,
    workers: Option<Arc<ThreadPool>>,
    format: PcmFormat,
    step_bytes: usize,
    /// Output samples still to be dropped.
    skip: u64,
    samples: u64,
    clipped: u64,
    /// Samples that earlier streams replaced; see [`RealPipeline::replaced`].
    replaced: u64,
    buffer: Vec<u8>,
    /// What the converters deliver without a signal.
    offsets: Vec<f64>,
    /// The changes of the filters.
    tuning: Option<Tuning>,
}

impl RealPipeline {
    /// A new stream of `plan`, which must be the plan of `bank`.
    ///
    /// # Errors
    /// [`PipelineError::Build`] for a bank without outputs or inputs whose gaps are to be filled.
    pub(super) fn new(
        bank: &Bank,
        plan: &Plan,
        format: PcmFormat,
        skip: u64,
        gaps: Option<GapPolicy>,
        workers: Option<Arc<ThreadPool>>,
    ) -> Result<Self, PipelineError> {
        let filler = gaps.map(|policy| GapFiller::new(bank, policy)).transpose()?;
        let delay = MaskDelay::new(plan.extra_latency());
        Ok(Self {
            stream: Stream::new(plan),
            gaps: filler.map(|filler| (filler, delay)),
            // Enough for all threads.
            step_bytes: if workers.is_some() { 8 * STEP_BYTES } else { STEP_BYTES },
            workers,
            format,
            skip,
            samples: 0,
            clipped: 0,
            replaced: 0,
            buffer: Vec::new(),
            offsets: bank.offsets.clone(),
            tuning: None,
        })
    }

    /// The plan.
    pub(super) fn plan(&self) -> &Plan {
        self.stream.plan()
    }

    /// The format of the output.
    pub(super) fn format(&self) -> PcmFormat {
        self.format
    }

    /// As [`super::Pipeline::retuned_by`].
    pub(super) fn retuned_by(
        self,
        bank: &Bank,
        options: Options,
        retuner: Box<dyn Retuner>,
    ) -> Result<Self, PipelineError> {
        Ok(Self { tuning: Some(Tuning::start(bank, options, retuner)?), ..self })
    }

    /// As [`super::Pipeline::settle`].
    pub(super) fn settle(&mut self, output: &mut impl Output) -> Result<(), PipelineError> {
        let Some(tuning) = &mut self.tuning else { return Ok(()) };
        tuning.settle()?;
        tuning.log(output)
    }

    /// As [`super::Pipeline::warnings`].
    pub(super) fn warnings(&self) -> &[String] {
        self.tuning.as_ref().map_or(&[], |tuning| &tuning.warnings)
    }

    /// Output samples so far.
    pub(super) fn samples(&self) -> u64 {
        self.samples
    }

    /// Output samples that saturated so far.
    pub(super) fn clipped(&self) -> u64 {
        self.clipped
    }

    /// Input samples so far that were NaN or infinite and became 0.
    pub(super) fn replaced(&self) -> u64 {
        self.replaced + self.stream.replaced()
    }

    /// The gaps that have ended, as in [`GapFiller::gaps`].
    pub(super) fn gaps(&self) -> &[Gap] {
        self.gaps.as_ref().map_or(&[], |(filler, _)| filler.gaps())
    }

    /// The gaps that go on.
    pub(super) fn open_gaps(&self) -> impl Iterator<Item = Gap> {
        self.gaps.iter().flat_map(|(filler, _)| filler.open())
    }

    /// Processes frames. The channels are those of all `parts`, one part after another.
    ///
    /// # Errors
    /// [`PipelineError::Process`] if the channels do not match the bank, or the errors of the output.
    pub(super) fn push(
        &mut self,
        parts: &[PcmFrames<'_>],
        output: &mut impl Output,
    ) -> Result<(), PipelineError> {
        match &mut self.tuning {
            Some(tuning) => {
                tuning.push(parts);
                self.run_tuned(output)
            }
            None => self.push_at_most(parts, u64::MAX, output),
        }
    }

    /// Processes frames without a signal (zeros, once the offsets are subtracted) until `samples` samples
    /// have been written since the beginning.
    ///
    /// # Errors
    /// The errors of the output.
    pub(super) fn flush(&mut self, samples: u64, output: &mut impl Output) -> Result<(), PipelineError> {
        if let Some(tuning) = &mut self.tuning {
            tuning.end();
            self.run_tuned(output)?;
            self.settle(output)?;
        }
        let layout = SampleLayout::packed(PcmFormat::F64Le);
        let (channels, ratio) = (self.stream.channels(), self.stream.ratio() as u64);
        let silence: Vec<u8> = self.offsets.iter().flat_map(|offset| offset.to_le_bytes()).collect();
        let silence = silence.repeat(FLUSH_FRAMES);
        while self.samples < samples {
            let wanted = samples - self.samples;
            let frames = (wanted + self.skip).div_ceil(ratio).min(FLUSH_FRAMES as u64) as usize;
            let part =
                PcmFrames { layout, channels, bytes: &silence[..frames * channels * layout.container] };
            // What is no signal says nothing of the filters.
            self.push_at_most(&[part], wanted, output)?;
        }
        Ok(())
    }

    /// Ends the open gaps and returns the outcome.
    pub(super) fn finish(mut self) -> Outcome {
        let gaps = self.gaps.as_mut().map(|(filler, _)| {
            filler.finish();
            let (count, missing, list) = (filler.total(), filler.missing(), filler.gaps().to_vec());
            GapSummary { count, missing, list }
        });
        Outcome {
            plan: self.stream.plan().summary(),
            channels: self.stream.channels(),
            ratio: self.stream.ratio(),
            samples: self.samples,
            clipped: self.clipped,
            replaced: self.replaced(),
            state_resets: self.stream.state_resets(),
            gaps,
        }
    }

    /// As [`RealPipeline::push`], with at most `limit` samples coming out.
    fn push_at_most(
        &mut self,
        parts: &[PcmFrames<'_>],
        limit: u64,
        output: &mut impl Output,
    ) -> Result<(), PipelineError> {
        let frames = parts.iter().map(PcmFrames::frames).min().unwrap_or(0);
        let step = self.step_frames();
        let (mut limit, mut first) = (limit, 0);
        while first < frames {
            let count = step.min(frames - first);
            limit -= self.step(&ranges(parts, first..first + count), limit, output)?;
            first += count;
        }
        Ok(())
    }

    /// Frames of a step, at most.
    fn step_frames(&self) -> usize {
        (self.step_bytes / self.stream.ratio() / self.format.bytes()).max(1)
    }

    /// Processes the frames that can be made of the samples so far, with filters that change on the way.
    fn run_tuned(&mut self, output: &mut impl Output) -> Result<(), PipelineError> {
        let step = self.step_frames();
        while let Some(tuning) = &mut self.tuning
            && let Some(bytes) = tuning.next(step)
        {
            if let Some(stream) = tuning.shifted()? {
                self.replaced += self.stream.replaced();
                self.stream = stream;
            }
            let frames = tuning.packed(&bytes);
            let count = frames.frames();
            self.step(&[frames], u64::MAX, output)?;
            self.change_filters(count, output)?;
        }
        Ok(())
    }

    /// Lets the stream go on with other filters after `count` frames, if they change there.
    fn change_filters(&mut self, count: usize, output: &mut impl Output) -> Result<(), PipelineError> {
        let Some(tuning) = &mut self.tuning else { return Ok(()) };
        let next = tuning.passed(count)?;
        tuning.log(output)?;
        if let Some(mut stream) = next {
            stream.continue_from(&self.stream)?;
            self.stream = stream;
        }
        Ok(())
    }

    /// One step; returns the samples that came out.
    fn step(
        &mut self,
        parts: &[PcmFrames<'_>],
        limit: u64,
        output: &mut impl Output,
    ) -> Result<u64, PipelineError> {
        let frames = parts.iter().map(PcmFrames::frames).min().unwrap_or(0);
        let samples = frames * self.stream.ratio();
        let skip = usize::try_from(self.skip).unwrap_or(usize::MAX).min(samples);
        let limit = usize::try_from(limit).unwrap_or(usize::MAX);
        let kept = skip..samples.min(skip.saturating_add(limit));
        let size = self.format.bytes();
        self.buffer.resize(samples * size, 0);
        let mut engine = Engine {
            stream: &mut self.stream,
            workers: self.workers.as_deref(),
            format: self.format,
            clipped: &mut self.clipped,
        };
        let mask = match &mut self.gaps {
            Some((filler, delay)) => {
                engine.run(&filler.fill_pcm(parts, &mut delay.block), &mut self.buffer, kept.clone())?;
                delay.enter();
                Some(delay.of(kept.clone()))
            }
            None => {
                engine.run(parts, &mut self.buffer, kept.clone())?;
                None
            }
        };
        output.write(Block { samples: &self.buffer[kept.start * size..kept.end * size], mask })?;
        if let Some((_, delay)) = &mut self.gaps {
            delay.leave();
        }
        self.skip -= skip as u64;
        self.samples += kept.len() as u64;
        Ok(kept.len() as u64)
    }
}

/// What filters and encodes a step.
struct Engine<'a> {
    stream: &'a mut Stream,
    workers: Option<&'a ThreadPool>,
    format: PcmFormat,
    clipped: &'a mut u64,
}

impl Engine<'_> {
    /// All output samples of the frames into `bytes`; of the clipped ones only those in `kept` are counted.
    fn run(
        &mut self,
        parts: &[PcmFrames<'_>],
        bytes: &mut [u8],
        kept: Range<usize>,
    ) -> Result<(), ProcessError> {
        let ratio = self.stream.ratio();
        let frames = bytes.len() / self.format.bytes() / ratio;
        // Floats do not clip; in most steps all samples are kept.
        if self.format.is_float() || kept == (0..frames * ratio) {
            *self.clipped += self.run_frames(parts, bytes)?;
            return Ok(());
        }
        // Whole frames before, within and after the kept samples, and between them partly kept frames.
        let whole = kept.start.div_ceil(ratio)..(kept.end / ratio).max(kept.start.div_ceil(ratio));
        let bounds = [0, kept.start / ratio, whole.start, whole.end, kept.end.div_ceil(ratio), frames];
        let mut first = 0;
        for (i, &bound) in bounds.iter().enumerate().skip(1) {
            let end = bound.max(first);
            let range = first..end;
            let place = range.start * ratio * self.format.bytes()..range.end * ratio * self.format.bytes();
            let (parts, bytes) = (ranges(parts, range.clone()), &mut bytes[place]);
            match i {
                2 | 4 => self.run_partly_kept(&parts, bytes, range.start * ratio, &kept)?,
                _ => {
                    let clipped = self.run_frames(&parts, bytes)?;
                    *self.clipped += if i == 3 { clipped } else { 0 };
                }
            }
            first = end;
        }
        Ok(())
    }

    /// Whole frames; returns how many samples were clipped.
    fn run_frames(&mut self, parts: &[PcmFrames<'_>], bytes: &mut [u8]) -> Result<u64, ProcessError> {
        let mut output = PcmOutput::packed(self.format, bytes);
        match self.workers {
            Some(workers) => self.stream.run_parallel(parts, &mut output, workers),
            None => self.stream.run(parts, &mut output),
        }?;
        Ok(output.clipped)
    }

    /// Frames whose samples, from number `first` on, are encoded and counted one by one.
    fn run_partly_kept(
        &mut self,
        parts: &[PcmFrames<'_>],
        bytes: &mut [u8],
        first: usize,
        kept: &Range<usize>,
    ) -> Result<(), ProcessError> {
        let size = self.format.bytes();
        let mut values = vec![0; bytes.len() / size * 8];
        self.stream.run(parts, &mut PcmOutput::packed(PcmFormat::F64Le, &mut values))?;
        for (n, (value, slot)) in values.chunks_exact(8).zip(bytes.chunks_exact_mut(size)).enumerate() {
            let value = PcmFormat::F64Le.decode(value);
            // The runtime rounds to f32 first where the format has fewer digits than that.
            let value = if size < 4 { f64::from(value as f32) } else { value };
            let clipped = self.format.encode(value, slot);
            *self.clipped += u64::from(clipped && kept.contains(&(first + n)));
        }
        Ok(())
    }
}

/// The same frames of all parts.
fn ranges<'a>(parts: &[PcmFrames<'a>], frames: Range<usize>) -> Vec<PcmFrames<'a>> {
    parts.iter().map(|part| part.range(frames.clone())).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Pipeline, Settings};
    use super::*;
    use crate::bank::SynthesisFilters;
    use crate::random::Random;
    use crate::runtime::{Algorithm, Options};
    use crate::units::Seconds;

    /// Samples in -1.5 .. 1.5, so that a third of them clips.
    fn noise(count: usize) -> Vec<f32> {
        let mut random = Random(1);
        (0..count).map(|_| 1.5 * random.sample() as f32).collect()
    }

    /// The whole output as numbers, by the plan itself.
    fn reference(plan: &Plan, input: &[f32], zeros: usize) -> Vec<f64> {
        let mut padded = input.to_vec();
        padded.resize(input.len() + zeros * plan.channels(), 0.0);
        let mut out = vec![0.0; padded.len() / plan.channels() * plan.ratio()];
        Stream::new(plan).process(&padded, &mut out).unwrap();
        out.iter().map(|&x| f64::from(x)).collect()
    }

    #[test]
    fn only_samples_of_the_output_are_counted_as_clipped() {
        for (m, skip, frames, algorithm) in [
            (1, 0, 50, Algorithm::Direct),
            (2, 3, 50, Algorithm::Direct),
            (3, 4, 50, Algorithm::Direct),
            (3, 7, 1, Algorithm::Direct),
            (5, 2, 40, Algorithm::Direct),
            (4, 37, 60, Algorithm::Direct),
            (8, 9, 1, Algorithm::Direct),
            (2, 5, 700, Algorithm::OverlapSave { transform: None }),
        ] {
            let taps = vec![noise(4 * m).iter().map(|&x| f64::from(x)).collect(), vec![0.7; 2 * m]];
            let bank = Bank { delays: vec![Seconds(0.0); 2], ..Bank::bare(SynthesisFilters::Fir(taps), m) };
            let plan = bank.plan(Options { algorithm, ..Options::default() }).unwrap();
            let input = noise(2 * frames);
            let samples = frames * m;
            let all = reference(&plan, &input, (skip + plan.extra_latency()) / m + 2);
            let skip = skip + plan.extra_latency();
            for format in [PcmFormat::S8, PcmFormat::S16Le, PcmFormat::S24Be, PcmFormat::F32Le] {
                let settings = Settings { skip: skip as u64, ..Settings::plain(format) };
                let mut pipeline = Pipeline::new(&bank, &plan, settings).unwrap();
                let mut got = Vec::new();
                let bytes: Vec<u8> = input.iter().flat_map(|x| x.to_le_bytes()).collect();
                // Pieces of 3 frames, so that borders of blocks and of what is kept meet in all ways.
                for piece in bytes.chunks(8 * 3) {
                    let layout = SampleLayout::packed(PcmFormat::F32Le);
                    pipeline.push(&[PcmFrames { layout, channels: 2, bytes: piece }], &mut got).unwrap();
                }
                pipeline.flush(samples as u64, &mut got).unwrap();
                let mut want = vec![0; samples * format.bytes()];
                let kept = all[skip..skip + samples].iter().zip(want.chunks_exact_mut(format.bytes()));
                let clipped: u64 = kept.map(|(&x, slot)| u64::from(format.encode(x, slot))).sum();
                let outcome = pipeline.finish();
                assert_eq!(
                    (outcome.samples, outcome.clipped),
                    (samples as u64, clipped),
                    "{m} {skip} {format}"
                );
                assert!(got == want, "{m} {skip} {format}");
                assert!(clipped > 0 || format == PcmFormat::F32Le || samples < 10);
            }
        }
    }
}
