use super::*;
use crate::bank::SynthesisFilters;
use crate::io::{IoError, PcmFormat, PcmFrames, SampleLayout};
use crate::pipeline::{Block, Output, Pipeline, Settings};
use crate::random::Random;
use crate::runtime::{Algorithm, Options, PcmOutput, Planar};
use crate::units::Seconds;
use std::cell::Cell;

/// What the command writes: samples and marks.
#[derive(Default)]
struct Written {
    samples: Vec<u8>,
    mask: Vec<u8>,
}

impl Output for Written {
    fn write(&mut self, block: Block<'_>) -> Result<(), IoError> {
        self.samples.extend_from_slice(block.samples);
        self.mask.extend_from_slice(block.mask.unwrap_or_default());
        Ok(())
    }
}

fn bank(taps: usize, ratio: usize, latency: usize) -> Bank {
    let mut random = Random(5);
    let taps: Vec<Vec<f64>> = (0..2).map(|_| (0..taps).map(|_| random.sample()).collect()).collect();
    let bare = Bank::bare(SynthesisFilters::Fir(taps), ratio);
    Bank { latency, delays: vec![Seconds(0.0); 2], offsets: vec![0.25, 0.0], ..bare }
}

/// Two channels in -1.5 .. 1.5, with a run of NaN in the second if `gap`.
fn channels(frames: usize, gap: bool) -> [Vec<f32>; 2] {
    let mut random = Random(6);
    let mut channel = || -> Vec<f32> { (0..frames).map(|_| 1.5 * random.sample() as f32).collect() };
    let mut both = [channel(), channel()];
    if gap {
        both[1].iter_mut().skip(frames / 3).take(7).for_each(|x| *x = f32::NAN);
    }
    both
}

/// As `hybank fuse` does it, from mono recordings.
fn command(
    bank: &Bank,
    plan: &Plan,
    both: &[Vec<f32>; 2],
    settings: Settings,
) -> (Written, super::super::Outcome) {
    let mut pipeline = Pipeline::new(bank, plan, settings).unwrap();
    let bytes = both.each_ref().map(|x| x.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    let layout = SampleLayout::packed(PcmFormat::F32Le);
    let parts = bytes.each_ref().map(|bytes| PcmFrames { layout, channels: 1, bytes });
    let mut written = Written::default();
    pipeline.push(&parts, &mut written).unwrap();
    pipeline.flush((both[0].len() * bank.ratio) as u64, &mut written).unwrap();
    (written, pipeline.finish())
}

#[test]
fn a_whole_signal_has_the_bits_of_the_command() {
    let pool = ThreadPool::new(2).unwrap();
    for (ratio, latency, frames, algorithm) in [
        (2, 0, 50, Algorithm::Direct),
        (2, 5, 400, Algorithm::Direct),
        (3, 31, 4, Algorithm::Direct),
        (4, 6, 0, Algorithm::Direct),
        (1, 3, 70_001, Algorithm::Direct),
        (2, 9, 3000, Algorithm::OverlapSave { transform: None }),
        (2, 9, 30, Algorithm::OverlapSave { transform: None }),
    ] {
        let bank = bank(24, ratio, latency);
        let plan = bank.plan(Options { algorithm, ..Options::default() }).unwrap();
        for (gap, keep_latency, format) in [
            (false, false, PcmFormat::F32Le),
            (false, true, PcmFormat::S16Le),
            (true, false, PcmFormat::S16Le),
        ] {
            let both = channels(frames, gap);
            let gaps = gap.then_some(GapPolicy::Hold);
            let skip = if keep_latency { plan.extra_latency() } else { plan.latency() } as u64;
            let (want, outcome) =
                command(&bank, &plan, &both, Settings { skip, gaps, ..Settings::plain(format) });
            let planes = both.each_ref().map(Vec::as_slice);
            let mut bytes = vec![0; frames * ratio * format.bytes()];
            let mut output = PcmOutput::packed(format, &mut bytes);
            let settings = WholeSettings { keep_latency, gaps, workers: Some(&pool) };
            let whole = fuse(&bank, &plan, &Planar::new(&planes).unwrap(), &mut output, settings).unwrap();
            let case = format!("M = {ratio}, m0 = {latency}, {frames} frames, {algorithm:?}, {format}");
            assert_eq!(output.clipped, outcome.clipped, "{case}");
            assert!(bytes == want.samples, "{case}");
            assert_eq!((whole.replaced, whole.gaps), (outcome.replaced, outcome.gaps), "{case}");
            assert_eq!(whole.mask.unwrap_or_default(), want.mask, "{case}");
        }
    }
}

#[test]
fn an_output_that_is_too_short_and_channels_that_do_not_match_are_refused() {
    let bank = bank(8, 2, 3);
    let plan = bank.plan(Options::default()).unwrap();
    let input = Interleaved::new(&[0.0f32; 8], 2).unwrap();
    let short = fuse(&bank, &plan, &input, &mut [0.0f32; 7][..], WholeSettings::default());
    assert!(matches!(
        short,
        Err(PipelineError::Process(ProcessError::OutputTooShort { given: 7, wanted: 8 }))
    ));
    let mono = Interleaved::new(&[0.0f32; 8], 1).unwrap();
    for gaps in [None, Some(GapPolicy::Zero)] {
        let settings = WholeSettings { gaps, ..WholeSettings::default() };
        let refused = fuse(&bank, &plan, &mono, &mut [0.0f32; 16][..], settings);
        assert!(matches!(
            refused,
            Err(PipelineError::Process(ProcessError::Channels { given: 1, wanted: 2 }))
        ));
    }
}

/// Long filters make short segments, so that a fusion that is stopped ends soon.
#[test]
fn segments_change_no_bit_and_a_fusion_ends_between_them() {
    let (bank, both) = (bank(2001, 2, 7), channels(140_001, false));
    let planes = both.each_ref().map(Vec::as_slice);
    let input = Planar::new(&planes).unwrap();
    for algorithm in [Algorithm::Direct, Algorithm::OverlapSave { transform: None }] {
        let plan = bank.plan(Options { algorithm, ..Options::default() }).unwrap();
        let mut at_once = vec![0.0f32; both[0].len() * 2];
        Stream::new(&plan).run(&input, &mut at_once[..]).unwrap();
        let asked = Cell::new(0);
        let run = |most: usize| {
            let (mut output, stop) = (vec![0.0f32; at_once.len()], || asked.replace(asked.get() + 1) == most);
            asked.set(0);
            let settings = WholeSettings { keep_latency: true, ..WholeSettings::default() };
            fuse_until(&bank, &plan, &input, &mut output[..], settings, &stop).map(|_| output)
        };
        let segments = run(usize::MAX).unwrap();
        let delay = plan.extra_latency();
        assert!(segments[..segments.len() - delay] == at_once[delay..], "{algorithm:?}");
        let questions = asked.get();
        assert!(questions >= both[0].len().div_ceil(segment(&bank, &plan, 1)), "{algorithm:?}");
        assert!(
            questions > 2 || plan.algorithm() == "overlap-save",
            "{algorithm:?}: asked {questions} times"
        );
        assert!(matches!(run(questions - 1), Err(PipelineError::Stopped)), "{algorithm:?}");
        assert_eq!(asked.get(), questions, "{algorithm:?}");
    }
}
