use super::*;
use crate::bank::StateSpace;
use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use crate::random::Random;
use crate::runtime::{Frames, Interleaved, Options, Stream};
use crate::units::Seconds;

fn fir_bank(taps: Vec<Vec<f64>>, ratio: usize) -> Bank {
    let delays = vec![Seconds(0.0); taps.len()];
    Bank { latency: 3, delays, ..Bank::bare(SynthesisFilters::Fir(taps), ratio) }
}

fn random_taps(channels: usize, taps: usize, random: &mut Random) -> Vec<Vec<f64>> {
    (0..channels).map(|_| (0..taps).map(|_| random.sample()).collect()).collect()
}

fn filler(bank: &Bank, policy: GapPolicy) -> GapFiller {
    GapFiller::new(bank, policy, 1, 0)
}

/// Fills whole frames; their marks, and whether they were filled.
fn fill(filler: &mut GapFiller, frames: &mut [f64]) -> (Vec<u8>, bool) {
    let n = filler.samples.len();
    let is_filled = filler.fill(&[Interleaved::new(frames, n).unwrap()]);
    if is_filled {
        frames.copy_from_slice(filler.filled(0));
    }
    (filler.marks(0..frames.len() / n * filler.ratio).to_vec(), is_filled)
}

/// Frames of N channels with a few runs of NaN.
fn with_gaps(n: usize, frames: usize, random: &mut Random) -> Vec<f64> {
    let mut samples: Vec<f64> = (0..n * frames).map(|_| random.sample() + 2.0).collect();
    for (channel, first, length) in [(0, 0, 3), (1, 40, 1), (0, 41, 20), (1, 190, 10)] {
        (first..first + length).for_each(|k| samples[k * n + channel] = f64::NAN);
    }
    samples
}

fn run(bank: &crate::bank::Bank, frames: &[f64]) -> Vec<f64> {
    let mut stream = Stream::new(&bank.plan(Options::default()).unwrap());
    let mut out = vec![0.0; frames.len() / bank.channel_count() * bank.ratio];
    stream.process(frames, &mut out).unwrap();
    out
}

#[test]
fn gaps_are_found_and_filled() {
    let mut random = Random(11);
    let bank = fir_bank(random_taps(2, 7, &mut random), 3);
    let samples = with_gaps(2, 200, &mut random);
    for policy in [GapPolicy::Zero, GapPolicy::Hold] {
        let mut gaps = filler(&bank, policy);
        let mut filled = samples.clone();
        // In pieces, so that a gap crosses a border.
        filled.chunks_mut(2 * 45).for_each(|piece| drop(fill(&mut gaps, piece)));
        let summary = gaps.finish();
        let gap = |channel, first, length| Gap { channel, first, length };
        assert_eq!(summary.list, [gap(1, 0, 3), gap(2, 40, 1), gap(1, 41, 20), gap(2, 190, 10)]);
        assert_eq!((summary.count, summary.missing), (4, 34));
        for (k, frame) in filled.chunks_exact(2).enumerate() {
            for i in 0..2 {
                let last = (0..=k).rev().map(|k| samples[2 * k + i]).find(|x| x.is_finite());
                let held = if samples[2 * k + i].is_nan() && policy == GapPolicy::Zero { None } else { last };
                assert_eq!(frame[i], held.unwrap_or(0.0), "{policy:?} frame {k} channel {i}");
            }
        }
    }
}

#[test]
fn the_mask_marks_exactly_the_outputs_that_a_missing_sample_can_change() {
    let mut random = Random(12);
    for (taps, m) in [(24, 2), (7, 3), (1, 1), (64, 4), (5, 8)] {
        let bank = fir_bank(random_taps(2, taps, &mut random), m);
        let samples = with_gaps(2, 200, &mut random);
        let variant = |value: f64| -> Vec<f64> {
            samples.iter().map(|x| if x.is_finite() { *x } else { value }).collect()
        };
        // Two values for all missing samples: an output differs if and only if one of them enters
        // it (random taps do not cancel).
        let differs: Vec<u8> = run(&bank, &variant(100.0))
            .iter()
            .zip(run(&bank, &variant(-77.0)))
            .map(|(a, b)| u8::from(*a != b))
            .collect();
        let (mask, _) = fill(&mut filler(&bank, GapPolicy::Zero), &mut samples.clone());
        assert_eq!(mask, differs, "{taps} taps, M = {m}");
    }
}

#[test]
fn a_missing_sample_is_zero_or_held_after_the_offset_is_subtracted() {
    let bank = Bank { offsets: vec![0.5, -0.25], ..fir_bank(vec![vec![1.0]; 2], 1) };
    let frames = [f64::NAN, 1.0, 2.0, f64::NAN, f64::NAN, f64::NAN];
    for (policy, want) in [
        (GapPolicy::Zero, [0.5, 1.0, 2.0, -0.25, 0.5, -0.25]),
        (GapPolicy::Hold, [0.5, 1.0, 2.0, 1.0, 2.0, 1.0]),
    ] {
        let mut filled = frames;
        fill(&mut filler(&bank, policy), &mut filled);
        assert_eq!(filled, want, "{policy:?}");
    }
}

#[test]
fn a_bank_without_states_forgets_at_once() {
    let fir = fir_bank(vec![vec![1.0; 2]; 2], 2);
    let d = vec![vec![0.5, 0.0], vec![0.25, 1.0]];
    let filter = StateSpace { a: vec![], b: vec![], c: vec![vec![], vec![]], d };
    let bank = Bank { filters: SynthesisFilters::StateSpace(filter), ..fir };
    let frames = &mut [1.0, 1.0, 1.0, f64::NAN, f64::NAN, 1.0, 1.0, 1.0];
    let (mask, _) = fill(&mut filler(&bank, GapPolicy::Zero), frames);
    assert_eq!(mask, [0, 0, 0, 1, 1, 1, 0, 0]);
}

#[test]
fn stored_samples_pass_untouched_or_as_the_same_numbers() {
    let mut random = Random(13);
    let samples = with_gaps(2, 200, &mut random);
    let bytes: Vec<u8> = samples.iter().flat_map(|x| x.to_be_bytes()).collect();
    let layout = SampleLayout::packed(PcmFormat::F64Be);
    let fir = fir_bank(random_taps(2, 7, &mut random), 3);
    let (b, c, d) = Default::default();
    let filter = StateSpace { a: vec![vec![0.5]], b, c, d };
    let recursion = Bank { filters: SynthesisFilters::StateSpace(filter), ..fir.clone() };
    for bank in [fir, recursion] {
        let mut want = samples.clone();
        let mut plain = filler(&bank, GapPolicy::Hold);
        let (want_mask, _) = fill(&mut plain, &mut want);
        for block in [1, 7, 45, 200] {
            let mut gaps = filler(&bank, GapPolicy::Hold);
            let (mut got, mut got_mask, mut untouched) = (Vec::new(), Vec::new(), 0);
            for (piece, numbers) in bytes.chunks(block * 16).zip(samples.chunks(block * 2)) {
                let recordings = &[PcmFrames { layout, channels: 2, bytes: piece }][..];
                let is_filled = gaps.fill(&[Frames::new(&recordings, 0..block)]);
                untouched += usize::from(!is_filled);
                got.extend_from_slice(if is_filled { gaps.filled(0) } else { numbers });
                got_mask.extend_from_slice(gaps.marks(0..numbers.len() / 2 * 3));
            }
            assert_eq!((got, got_mask), (want.clone(), want_mask.clone()), "blocks of {block}");
            assert_eq!(gaps.summary(), plain.summary());
            assert!(untouched > 0 || block == 200, "blocks of {block}");
        }
    }
}

#[test]
fn a_complex_sample_is_missing_with_either_of_its_parts() {
    let bank = Bank { offsets: vec![0.25], ..fir_bank(vec![vec![1.0]], 1) };
    let (real, imaginary) = ([1.0, f64::NAN, 3.0, 4.0], [10.0, 20.0, f64::INFINITY, 40.0]);
    for (policy, want) in [
        (GapPolicy::Hold, [[1.0, 1.0, 1.0, 4.0], [10.0, 10.0, 10.0, 40.0]]),
        (GapPolicy::Zero, [[1.0, 0.25, 0.25, 4.0], [10.0, 0.25, 0.25, 40.0]]),
    ] {
        let mut gaps = GapFiller::new(&bank, policy, 2, 0);
        assert!(gaps.fill(&[&real, &imaginary].map(|part| Interleaved::new(part, 1).unwrap())));
        assert_eq!([gaps.filled(0), gaps.filled(1)], want);
        assert_eq!(gaps.marks(0..4), [0, 1, 1, 0]);
        let list = vec![Gap { channel: 1, first: 1, length: 2 }];
        assert_eq!(gaps.finish(), GapSummary { count: 1, missing: 2, list });
    }
}

#[test]
fn marks_come_later_by_the_latency_of_the_algorithm_whatever_the_blocks() {
    let bank = fir_bank(vec![vec![1.0]], 1);
    let samples: Vec<f64> = (0..40).map(|k| if k % 7 == 3 { f64::NAN } else { 1.0 }).collect();
    for latency in [0, 1, 6, 50] {
        let mut want = vec![0; latency];
        want.extend(samples.iter().map(|x| u8::from(x.is_nan())));
        let mut gaps = GapFiller::new(&bank, GapPolicy::Zero, 1, latency);
        let mut got = Vec::new();
        for block in [&samples[..3], &samples[3..3], &samples[3..20], &samples[20..]] {
            gaps.fill(&[Interleaved::new(block, 1).unwrap()]);
            got.extend_from_slice(gaps.marks(0..block.len()));
        }
        assert_eq!(got, want[..40], "{latency}");
    }
}

/// The definition: output p of frame k is affected if f_i[p + jM] is not zero for a missing x_i[k - j].
fn affected(taps: &[Vec<f64>], m: usize, samples: &[f64]) -> Vec<u8> {
    let n = taps.len();
    let touches = |k: usize, p: usize, i: usize| {
        let lags = (0..=k).take_while(|j| p + j * m < taps[i].len());
        lags.into_iter().any(|j| taps[i][p + j * m] != 0.0 && samples[(k - j) * n + i].is_nan())
    };
    let outputs = (0..samples.len() / n).flat_map(|k| (0..m).map(move |p| (k, p)));
    outputs.map(|(k, p)| u8::from((0..n).any(|i| touches(k, p, i)))).collect()
}

#[test]
fn the_mask_is_that_of_the_definition_for_filters_with_zeros_and_any_gaps() {
    let mut random = Random(14);
    for trial in 0..200 {
        let (n, m, length) = (1 + random.below(3), 1 + random.below(4), 1 + random.below(40));
        let mut taps = random_taps(n, length, &mut random);
        // From none to nearly all taps are zero, in runs too.
        let zeros = random.below(10);
        for tap in taps.iter_mut().flatten() {
            if random.below(10) < zeros {
                *tap = 0.0;
            }
        }
        let start = random.below(length);
        taps[0][..start].fill(0.0);
        let mut samples: Vec<f64> = (0..n * 150).map(|_| random.sample()).collect();
        for _ in 0..random.below(12) {
            let (i, first, run) = (random.below(n), random.below(150), 1 + random.below(30));
            (first..(first + run).min(150)).for_each(|k| samples[k * n + i] = f64::NAN);
        }
        let mut gaps = filler(&fir_bank(taps.clone(), m), GapPolicy::Hold);
        let mut got = Vec::new();
        let mut rest = &samples[..];
        while !rest.is_empty() {
            let (piece, after) = rest.split_at(rest.len().min(n * (1 + random.below(40))));
            got.extend(fill(&mut gaps, &mut piece.to_vec()).0);
            rest = after;
        }
        assert_eq!(got, affected(&taps, m, &samples), "trial {trial}: {taps:?}");
    }
}

#[test]
fn nonzero_taps_that_follow_each_other_are_one_run() {
    assert_eq!(nonzero_runs([0.0, 1.0, 2.0, 0.0, 3.0].into_iter()), [1..3, 4..5]);
}
