use super::*;
use crate::bank::SynthesisFilters;
use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use crate::pipeline::gaps::tests::Mean;
use crate::pipeline::{Block, DroppedLatency, GapEstimator, Pipeline};
use crate::random::Random;
use crate::runtime::{Algorithm, Interleaved, Options, PcmOutput, Planar, SideBySide, Stream, Zeros};
use crate::units::Seconds;
use std::cell::Cell;
use std::sync::Arc;

const NEVER: &dyn Fn() -> bool = &|| false;

/// What the command writes: samples and marks.
#[derive(Default)]
struct Written {
    samples: Vec<u8>,
    mask: Vec<u8>,
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

/// As `hybank fuse` does it: blocks of frames, with as many outputs as frames.
fn command(
    bank: &Bank,
    plan: &Plan,
    parts: &[&dyn FrameSource],
    settings: Settings<'_>,
    (format, is_complex): (PcmFormat, bool),
) -> (Written, Outcome) {
    let mut pipeline = Pipeline::new(bank, plan, settings, format, is_complex);
    let mut written = Written::default();
    let mut write = |block: Block<'_>| {
        written.samples.extend_from_slice(block.samples);
        written.mask.extend_from_slice(block.mask.unwrap_or_default());
        Ok(())
    };
    pipeline.push_parts(parts, &mut write).unwrap();
    pipeline.flush((parts[0].frames() * bank.ratio) as u64, &mut write).unwrap();
    (written, pipeline.finish())
}

/// Estimates of missing samples of two converters.
fn mean() -> Arc<dyn GapEstimator> {
    Arc::new(Mean { reach: 5, samples: 2 })
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
        (2, 9, 3000, Algorithm::OverlapSave),
        (2, 9, 30, Algorithm::OverlapSave),
    ] {
        let bank = bank(24, ratio, latency);
        let plan = bank.plan(Options { algorithm, ..Options::default() }).unwrap();
        let (floats, words) = (PcmFormat::F32Le, PcmFormat::S16Le);
        for (gap, keep_latency, format) in
            [(false, false, floats), (false, true, words), (true, false, words)]
        {
            let both = channels(frames, gap);
            let gaps = gap.then(mean);
            let dropped = if keep_latency { DroppedLatency::Added } else { DroppedLatency::All };
            let settings = Settings { dropped, gaps, ..Settings::default() };
            let stored = both.each_ref().map(|x| x.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
            let layout = SampleLayout::packed(PcmFormat::F32Le);
            let recordings = stored.each_ref().map(|bytes| PcmFrames { layout, channels: 1, bytes });
            let recording = SideBySide::new(&recordings[..]);
            let (want, outcome) = command(&bank, &plan, &[&recording], settings.clone(), (format, false));
            let planes = both.each_ref().map(Vec::as_slice);
            let mut bytes = vec![0; frames * ratio * format.bytes()];
            let mut output = PcmOutput::packed(format, &mut bytes);
            let settings = Settings { workers: Some(&pool), ..settings };
            let input = Planar::new(&planes).unwrap();
            let whole = fuse(&bank, &plan, &[&input], &mut output, settings, NEVER).unwrap();
            let case = format!("M = {ratio}, m0 = {latency}, {frames} frames, {algorithm:?}, {format}");
            assert_eq!(output.clipped, outcome.clipped, "{case}");
            assert!(bytes == want.samples, "{case}");
            assert_eq!((whole.replaced, whole.gaps), (outcome.replaced, outcome.gaps), "{case}");
            assert_eq!(whole.mask.unwrap_or_default(), want.mask, "{case}");
        }
    }
}

/// IQ with gaps: the arrays of Python and the blocks of the command line have the same bits, and a gap is
/// counted once.
#[test]
fn complex_samples_with_gaps_have_the_bits_and_gaps_of_the_command() {
    let (bank, frames) = (bank(24, 2, 5), 300);
    let plan = bank.plan(Options::default()).unwrap();
    let mut random = Random(8);
    let mut samples: Vec<f32> = (0..4 * frames).map(|_| random.sample() as f32).collect();
    // Of frame 40 the imaginary part of channel 1, of frames 90 and 91 a part each of channel 2.
    [4 * 40 + 1, 4 * 90 + 2, 4 * 91 + 3].into_iter().for_each(|number| samples[number] = f32::NAN);
    let bytes: Vec<u8> = samples.iter().flat_map(|x| x.to_le_bytes()).collect();
    let recording = PcmFrames { layout: SampleLayout::packed(PcmFormat::F32Le), channels: 4, bytes: &bytes };
    let settings = Settings { gaps: Some(mean()), ..Settings::default() };
    let (real, imaginary) = (recording.part(0), recording.part(1));
    let parts: [&dyn FrameSource; 2] = [&real, &imaginary];
    let (want, outcome) = command(&bank, &plan, &parts, settings.clone(), (PcmFormat::F32Le, true));
    let mut bytes = vec![0; want.samples.len()];
    let mut output = PcmOutput::packed(PcmFormat::F32Le, &mut bytes);
    let whole = fuse(&bank, &plan, &parts, &mut output, settings, NEVER).unwrap();
    assert!(bytes == want.samples);
    assert_eq!(whole.mask.as_deref(), Some(&want.mask[..]));
    assert_eq!((whole.samples, &whole.gaps), (outcome.samples, &outcome.gaps));
    let gaps: Vec<_> =
        whole.gaps.unwrap().list.iter().map(|gap| (gap.channel, gap.first, gap.length)).collect();
    assert_eq!(gaps, [(1, 40, 1), (2, 90, 2)]);
}

#[test]
fn an_output_that_is_too_short_and_channels_that_do_not_match_are_refused() {
    let bank = bank(8, 2, 3);
    let plan = bank.plan(Options::default()).unwrap();
    let input = Interleaved::new(&[0.0f32; 8], 2).unwrap();
    let short = fuse(&bank, &plan, &[&input], &mut [0.0f32; 7].as_mut_slice(), Settings::default(), NEVER);
    assert!(matches!(
        short,
        Err(PipelineError::Process(ProcessError::OutputTooShort { given: 7, wanted: 8 }))
    ));
    let mono = Interleaved::new(&[0.0f32; 8], 1).unwrap();
    for gaps in [None, Some(mean())] {
        let settings = Settings { gaps, ..Settings::default() };
        let refused = fuse(&bank, &plan, &[&mono], &mut [0.0f32; 16].as_mut_slice(), settings, NEVER);
        assert!(matches!(
            refused,
            Err(PipelineError::Process(ProcessError::Channels { given: 1, wanted: 2 }))
        ));
    }
}

/// A fusion that is stopped ends soon.
#[test]
fn segments_change_no_bit_and_a_fusion_ends_between_them() {
    let (bank, both) = (bank(2001, 2, 7), channels(280_001, false));
    let planes = both.each_ref().map(Vec::as_slice);
    let input = Planar::new(&planes).unwrap();
    for algorithm in [Algorithm::Direct, Algorithm::OverlapSave] {
        let plan = bank.plan(Options { algorithm, ..Options::default() }).unwrap();
        let mut at_once = vec![0.0f32; both[0].len() * 2];
        Stream::new(&plan).run(&input, &mut at_once.as_mut_slice()).unwrap();
        let asked = Cell::new(0);
        let run = |most: usize| {
            let (mut output, stop) = (vec![0.0f32; at_once.len()], || asked.replace(asked.get() + 1) == most);
            asked.set(0);
            let settings = Settings { dropped: DroppedLatency::Added, ..Settings::default() };
            fuse(&bank, &plan, &[&input], &mut output.as_mut_slice(), settings, &stop).map(|_| output)
        };
        let segments = run(usize::MAX).unwrap();
        let delay = plan.extra_latency();
        assert!(segments[..segments.len() - delay] == at_once[delay..], "{algorithm:?}");
        let questions = asked.get();
        assert!(questions >= both[0].len().div_ceil(step(&plan, &Settings::default())), "{algorithm:?}");
        assert!(questions > 2 || plan.algorithm() == "overlap-save", "{algorithm:?}: {questions} questions");
        assert!(matches!(run(questions - 1), Err(PipelineError::Stopped)), "{algorithm:?}");
        assert_eq!(asked.get(), questions, "{algorithm:?}");
    }
}

#[test]
fn more_frames_than_can_be_counted_are_refused() {
    let bank = bank(4, 2, 0);
    let plan = bank.plan(Options::default()).unwrap();
    // Twice as many samples are 0 modulo the size of a word.
    let endless = Zeros { channels: 2, frames: usize::MAX / 2 + 1 };
    let fused = fuse(&bank, &plan, &[&endless], &mut [0.0; 4].as_mut_slice(), Settings::default(), NEVER);
    let wanted = ProcessError::TooManyFrames { frames: endless.frames, ratio: 2 };
    assert!(matches!(fused, Err(PipelineError::Process(error)) if error == wanted));
}
