use super::super::gaps::tests::Mean;
use super::super::{DroppedLatency, GapEstimator};
use super::*;
use crate::bank::SynthesisFilters;
use crate::io::{PcmFrames, SampleLayout};
use crate::random::Random;
use crate::runtime::{Algorithm, Options, Stream};
use crate::units::Seconds;
use std::sync::Arc;

/// Samples in -1.5 .. 1.5, so that a third of them clips.
fn noise(count: usize) -> Vec<f32> {
    let mut random = Random(1);
    (0..count).map(|_| 1.5 * random.sample() as f32).collect()
}

/// Appends what is written.
fn append(all: &mut Vec<u8>) -> impl FnMut(Block<'_>) -> Result<(), IoError> {
    |block| {
        all.extend_from_slice(block.samples);
        Ok(())
    }
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
        (2, 5, 700, Algorithm::OverlapSave),
    ] {
        let taps = vec![noise(4 * m).iter().map(|&x| f64::from(x)).collect(), vec![0.7; 2 * m]];
        let bank = Bank {
            delays: vec![Seconds(0.0); 2],
            latency: skip,
            ..Bank::bare(SynthesisFilters::Fir(taps), m)
        };
        let plan = bank.plan(Options { algorithm, ..Options::default() }).unwrap();
        let input = noise(2 * frames);
        let samples = frames * m;
        let all = reference(&plan, &input, (skip + plan.extra_latency()) / m + 2);
        let skip = skip + plan.extra_latency();
        assert_eq!(skip, plan.latency());
        for format in [PcmFormat::S8, PcmFormat::S16Le, PcmFormat::S24Be, PcmFormat::F32Le] {
            let mut pipeline = Pipeline::new(&bank, &plan, Settings::default(), format, false);
            let mut got = Vec::new();
            let bytes: Vec<u8> = input.iter().flat_map(|x| x.to_le_bytes()).collect();
            // Pieces of 3 frames, so that borders of blocks and of what is kept meet in all ways.
            for piece in bytes.chunks(8 * 3) {
                let layout = SampleLayout::packed(PcmFormat::F32Le);
                let frames = PcmFrames { layout, channels: 2, bytes: piece };
                pipeline.push_parts(&[&frames], &mut append(&mut got)).unwrap();
            }
            pipeline.flush(samples as u64, &mut append(&mut got)).unwrap();
            let mut want = vec![0; samples * format.bytes()];
            let kept = all[skip..skip + samples].iter().zip(want.chunks_exact_mut(format.bytes()));
            let clipped: u64 = kept.map(|(&x, slot)| u64::from(format.encode(x, slot))).sum();
            let peak = all[skip..skip + samples].iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
            assert_eq!(pipeline.peak(), peak);
            let outcome = pipeline.finish();
            assert_eq!((outcome.samples, outcome.clipped), (samples as u64, clipped), "{m} {skip} {format}");
            assert!(got == want, "{m} {skip} {format}");
            assert!(clipped > 0 || format == PcmFormat::F32Le || samples < 10);
        }
    }
}

/// The output for complex frames of two channels, in pieces, and two samples after their end.
fn complex(input: &[[f32; 2]], gaps: Option<Arc<dyn GapEstimator>>) -> (Vec<f32>, Outcome) {
    let taps = vec![vec![1.0, 2.0, 3.0, 4.0], vec![-10.0, 20.0, 30.0, 0.5]];
    let bank = Bank { delays: vec![Seconds(0.0); 2], ..Bank::bare(SynthesisFilters::Fir(taps), 2) };
    let plan = bank.plan(Options::default()).unwrap();
    let settings = Settings { gaps, dropped: DroppedLatency::Nothing, ..Settings::default() };
    let mut pipeline = Pipeline::new(&bank, &plan, settings, PcmFormat::F32Le, true);
    let bytes: Vec<u8> = input.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let mut output = Vec::new();
    for piece in bytes.chunks(16 * 3) {
        let layout = SampleLayout::packed(PcmFormat::F32Le);
        let frames = PcmFrames { layout, channels: 4, bytes: piece };
        pipeline.push_parts(&[&frames.part(0), &frames.part(1)], &mut append(&mut output)).unwrap();
    }
    let samples = pipeline.samples() + pipeline.pending() + 2;
    pipeline.flush(samples, &mut append(&mut output)).unwrap();
    let numbers = output.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()));
    (numbers.collect(), pipeline.finish())
}

#[test]
fn each_part_of_complex_samples_has_the_bits_of_a_real_stream() {
    let input: Vec<[f32; 2]> = (0..40).map(|k| [(k % 7) as f32, (k % 5) as f32 - 2.0]).collect();
    let (got, outcome) = complex(&input, None);
    assert_eq!(outcome.samples, 42);
    let taps = vec![vec![1.0, 2.0, 3.0, 4.0], vec![-10.0, 20.0, 30.0, 0.5]];
    let plan = Plan::from_taps(&taps, 2, 0, Options::default()).unwrap();
    for part in 0..2 {
        let numbers: Vec<f32> = input.iter().map(|x| x[part]).chain([0.0; 2]).collect();
        let mut want = vec![0.0; 42];
        Stream::new(&plan).process(&numbers, &mut want).unwrap();
        assert!(got.iter().skip(part).step_by(2).eq(&want), "{part}");
    }
}

#[test]
fn a_sample_without_one_part_is_missing() {
    let input = vec![[1.0f32, -1.0]; 40];
    let mut holed = input.clone();
    (holed[9][1], holed[14][0]) = (f32::NAN, f32::NAN);
    // Samples that do not change are estimated exactly by means.
    let (got, outcome) = complex(&holed, Some(Arc::new(Mean { reach: 3, samples: 2 })));
    assert_eq!(got, complex(&input, None).0);
    let gaps = outcome.gaps.unwrap();
    let places: Vec<_> = gaps.list.iter().map(|gap| (gap.channel, gap.first, gap.length)).collect();
    assert_eq!((places, gaps.count, gaps.missing), (vec![(2, 4, 1), (1, 7, 1)], 2, 2));
}
