//! Complex samples as two real streams, and back.

use super::stage::RealPipeline;
use super::{Block, Output, PipelineError};
use crate::io::{IoError, PcmFrames, SampleLayout};

/// The stream of the imaginary parts, and buffers of both parts.
#[derive(Debug)]
pub(super) struct Imaginary {
    pub(super) pipeline: RealPipeline,
    /// A sample of which one part is not finite is missing as a whole.
    pub(super) couples_gaps: bool,
    output: Vec<u8>,
}

/// Output of one part.
#[derive(Debug, Default)]
struct Captured {
    samples: Vec<u8>,
    mask: Option<Vec<u8>>,
}

impl Output for Captured {
    fn write(&mut self, block: Block<'_>) -> Result<(), IoError> {
        self.samples.extend_from_slice(block.samples);
        if let Some(mask) = block.mask {
            self.mask.get_or_insert_default().extend_from_slice(mask);
        }
        Ok(())
    }
}

impl Imaginary {
    pub(super) fn new(pipeline: RealPipeline, couples_gaps: bool) -> Self {
        Self { pipeline, couples_gaps, output: Vec::new() }
    }

    /// Processes frames whose channels are real and imaginary parts in turn.
    pub(super) fn push(
        &mut self,
        real: &mut RealPipeline,
        parts: &[PcmFrames<'_>],
        output: &mut impl Output,
    ) -> Result<(), PipelineError> {
        let split: Vec<Split> = parts.iter().map(|frames| Split::of(frames, self.couples_gaps)).collect();
        let side = |side: usize| split.iter().map(|split| split.frames(side)).collect::<Vec<_>>();
        let [mut first, mut second] = [Captured::default(), Captured::default()];
        real.push(&side(0), &mut first)?;
        self.pipeline.push(&side(1), &mut second)?;
        self.join(first, &second, output)
    }

    /// As [`RealPipeline::flush`], of both parts.
    pub(super) fn flush(
        &mut self,
        real: &mut RealPipeline,
        samples: u64,
        output: &mut impl Output,
    ) -> Result<(), PipelineError> {
        let [mut first, mut second] = [Captured::default(), Captured::default()];
        real.flush(samples, &mut first)?;
        self.pipeline.flush(samples, &mut second)?;
        self.join(first, &second, output)
    }

    /// Writes both parts of each sample. Their masks are equal.
    fn join(
        &mut self,
        real: Captured,
        imaginary: &Captured,
        output: &mut impl Output,
    ) -> Result<(), PipelineError> {
        let size = self.pipeline.format().bytes();
        self.output.clear();
        for (real, imaginary) in real.samples.chunks_exact(size).zip(imaginary.samples.chunks_exact(size)) {
            self.output.extend_from_slice(real);
            self.output.extend_from_slice(imaginary);
        }
        Ok(output.write(Block { samples: &self.output, mask: real.mask.as_deref() })?)
    }
}

/// Both parts of some frames.
struct Split {
    layout: SampleLayout,
    channels: usize,
    sides: [Vec<u8>; 2],
}

impl Split {
    /// Of frames with two numbers per sample.
    fn of(frames: &PcmFrames<'_>, couples_gaps: bool) -> Self {
        let (layout, channels) = (frames.layout, frames.channels / 2);
        let container = layout.container;
        let mut sides = [0, 1].map(|_| Vec::with_capacity(frames.bytes.len() / 2));
        let is_missing = |part: &[u8]| !layout.format.decode(part).is_finite();
        let couples = couples_gaps && layout.format.is_float();
        for sample in frames.bytes.chunks_exact(2 * container) {
            let (mut real, mut imaginary) = sample.split_at(container);
            if couples && is_missing(real) {
                imaginary = real;
            } else if couples && is_missing(imaginary) {
                real = imaginary;
            }
            sides[0].extend_from_slice(real);
            sides[1].extend_from_slice(imaginary);
        }
        Self { layout, channels, sides }
    }

    fn frames(&self, side: usize) -> PcmFrames<'_> {
        PcmFrames { layout: self.layout, channels: self.channels, bytes: &self.sides[side] }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{GapPolicy, Pipeline, Settings};
    use super::*;
    use crate::bank::{Bank, SynthesisFilters};
    use crate::io::PcmFormat;
    use crate::runtime::{Options, Stream};
    use crate::units::Seconds;

    fn bank() -> Bank {
        let taps = vec![vec![1.0, 2.0, 3.0, 4.0], vec![-10.0, 20.0, 30.0, 0.5]];
        Bank { delays: vec![Seconds(0.0); 2], ..Bank::bare(SynthesisFilters::Fir(taps), 2) }
    }

    /// The output for complex frames of two channels, in pieces.
    fn run(input: &[[f32; 2]], gaps: Option<GapPolicy>) -> (Vec<f32>, super::super::Outcome) {
        let bank = bank();
        let plan = bank.plan(Options::default()).unwrap();
        let settings = Settings { gaps, is_complex: true, ..Settings::plain(PcmFormat::F32Le) };
        let mut pipeline = Pipeline::new(&bank, &plan, settings).unwrap();
        let bytes: Vec<u8> = input.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let mut output = Vec::new();
        for piece in bytes.chunks(16 * 3) {
            let layout = SampleLayout::packed(PcmFormat::F32Le);
            pipeline.push(&[PcmFrames { layout, channels: 4, bytes: piece }], &mut output).unwrap();
        }
        let samples = pipeline.samples() + 2;
        pipeline.flush(samples, &mut output).unwrap();
        let numbers = output.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()));
        (numbers.collect(), pipeline.finish())
    }

    #[test]
    fn the_output_is_that_of_two_streams() {
        let input: Vec<[f32; 2]> = (0..40).map(|k| [(k % 7) as f32, (k % 5) as f32 - 2.0]).collect();
        let plan = bank().plan(Options::default()).unwrap();
        let parts = [0, 1].map(|part| {
            let padded: Vec<f32> = input.iter().map(|x| x[part]).chain([0.0; 2]).collect();
            let mut want = vec![0.0f32; 42];
            Stream::new(&plan).process(&padded, &mut want).unwrap();
            want
        });
        let want: Vec<[f32; 2]> = parts[0].iter().zip(&parts[1]).map(|(&re, &im)| [re, im]).collect();
        let (got, outcome) = run(&input, None);
        assert_eq!((got, outcome.samples), (want.concat(), 42));
    }

    #[test]
    fn a_sample_without_one_part_is_missing() {
        let mut input = vec![[1.0f32, -1.0]; 40];
        let mut holed = input.clone();
        (holed[9][1], holed[14][0]) = (f32::NAN, f32::NAN);
        (input[9], input[14]) = ([0.0; 2], [0.0; 2]);
        let (got, outcome) = run(&holed, Some(GapPolicy::Zero));
        assert_eq!(got, run(&input, None).0);
        let gaps = outcome.gaps.unwrap();
        let places: Vec<_> = gaps.list.iter().map(|gap| (gap.channel, gap.first, gap.length)).collect();
        assert_eq!(places, [(2, 4, 1), (1, 7, 1)]);
    }
}
