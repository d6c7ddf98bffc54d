use super::*;
use crate::bank::{StateMatrices, SynthesisFilters};
use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use crate::random::Random;
use crate::runtime::{Algorithm, Frames, Interleaved, Options, Precision};
use crate::units::Seconds;

/// The mean of the known samples of the same place in the frames around.
#[derive(Debug)]
pub(in crate::pipeline) struct Mean {
    pub(in crate::pipeline) reach: usize,
    /// Of a frame.
    pub(in crate::pipeline) samples: usize,
}

impl GapEstimator for Mean {
    fn reach(&self) -> usize {
        self.reach
    }

    fn error(&self) -> f64 {
        1e-8
    }

    fn estimate(&self, is_there: &[bool]) -> GapEstimate {
        let middle = self.reach * self.samples;
        let missing = (0..self.samples).filter(|i| !is_there[middle + i]);
        let mean = |i: usize| {
            let known = |k: usize| k % self.samples == i && is_there[k];
            let count = (0..is_there.len()).filter(|&k| known(k)).count().max(1) as f64;
            (0..is_there.len()).map(|k| f64::from(u8::from(known(k))) / count).collect()
        };
        let weights: Vec<Vec<f64>> = missing.map(mean).collect();
        GapEstimate { deviations: vec![0.1; weights.len()], weights, added_error: 1e-3 }
    }
}

fn fir_bank(taps: Vec<Vec<f64>>, ratio: usize) -> Bank {
    let delays = vec![Seconds(0.0); taps.len()];
    Bank { latency: 3, delays, ..Bank::bare(SynthesisFilters::Fir(taps), ratio) }
}

fn random_taps(channels: usize, taps: usize, random: &mut Random) -> Vec<Vec<f64>> {
    (0..channels).map(|_| (0..taps).map(|_| random.sample()).collect()).collect()
}

fn plan(bank: &Bank) -> Plan {
    bank.plan(Options { precision: Precision::Double, ..Options::default() }).unwrap()
}

fn filler(bank: &Bank, reach: usize, parts: usize) -> GapFiller {
    let estimator = Mean { reach, samples: bank.frame_samples() };
    GapFiller::new(bank, &plan(bank), parts, Arc::new(estimator))
}

/// All frames of one part, in blocks, with their marks.
fn run(filler: &mut GapFiller, frames: &[f64], block: usize) -> (Vec<f64>, Vec<u8>) {
    let (n, ratio) = (filler.samples.len(), filler.layout.ratio());
    let (mut filled, mut marks) = (Vec::new(), Vec::new());
    let mut take = |filler: &mut GapFiller, out: usize| {
        filled.extend_from_slice(filler.filled(0));
        marks.extend_from_slice(filler.marks(0..out * ratio));
    };
    for piece in frames.chunks(n * block) {
        let out = filler.fill(&[Interleaved::new(piece, n).unwrap()]);
        take(filler, out);
    }
    let out = filler.fill_after_end(filler.held());
    take(filler, out);
    (filled, marks)
}

/// Frames of N channels with a few runs of NaN.
fn with_gaps(n: usize, frames: usize, random: &mut Random) -> Vec<f64> {
    let mut samples: Vec<f64> = (0..n * frames).map(|_| random.sample() + 2.0).collect();
    for (channel, first, length) in [(0, 0, 3), (1, 40, 1), (0, 41, 20), (1, 190, 10)] {
        (first..first + length).for_each(|k| samples[k * n + channel] = f64::NAN);
    }
    samples
}

#[test]
fn gaps_are_found_and_estimated_from_the_frames_around() {
    let mut random = Random(11);
    let bank = Bank { offsets: vec![0.5, -0.25], ..fir_bank(random_taps(2, 7, &mut random), 3) };
    let samples = with_gaps(2, 200, &mut random);
    let mut gaps = filler(&bank, 4, 1);
    let (filled, _) = run(&mut gaps, &samples, 45);
    let summary = gaps.finish();
    let snr_db = Decibels::of_power(1.0 / (1e-8 + 1e-3));
    let gap = |channel, first, length| Gap { channel, first, length, snr_db };
    assert_eq!(summary.list, [gap(1, 0, 3), gap(2, 40, 1), gap(1, 41, 20), gap(2, 190, 10)]);
    assert_eq!((summary.count, summary.missing), (4, 34));
    for (k, frame) in filled.chunks_exact(2).enumerate() {
        for i in 0..2 {
            let around = (k.saturating_sub(4)..(k + 5).min(200)).map(|k| samples[2 * k + i]);
            let known: Vec<f64> = around.filter(|x| x.is_finite()).collect();
            // Nothing is known amid a long gap: what the converter delivers without a signal.
            let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
            let want = if samples[2 * k + i].is_finite() {
                samples[2 * k + i]
            } else if known.is_empty() {
                bank.offsets[i]
            } else {
                mean
            };
            assert!((frame[i] - want).abs() < 1e-12, "frame {k} channel {i}");
        }
    }
}

#[test]
fn whatever_the_blocks_the_samples_and_marks_are_the_same() {
    let mut random = Random(13);
    let samples = with_gaps(2, 200, &mut random);
    let bytes: Vec<u8> = samples.iter().flat_map(|x| x.to_be_bytes()).collect();
    let layout = SampleLayout::packed(PcmFormat::F64Be);
    let fir = fir_bank(random_taps(2, 7, &mut random), 3);
    let filter = StateMatrices {
        a: vec![vec![0.5]],
        b: vec![vec![1.0, 1.0]],
        c: vec![vec![1.0]; 3],
        d: vec![vec![0.0; 2]; 3],
    };
    let recursion = Bank { filters: SynthesisFilters::StateSpace(filter), ..fir.clone() };
    for bank in [fir, recursion] {
        let mut whole = filler(&bank, 5, 1);
        let want = run(&mut whole, &samples, 200);
        assert_eq!(want.0.len(), samples.len());
        for block in [1, 7, 45] {
            let mut gaps = filler(&bank, 5, 1);
            assert_eq!(run(&mut gaps, &samples, block), want, "blocks of {block}");
            assert_eq!(gaps.summary(), whole.summary());
        }
        let recording = PcmFrames { layout, channels: 2, bytes: &bytes };
        let mut gaps = filler(&bank, 5, 1);
        let out = gaps.fill(&[Frames::new(&recording, 0..200)]);
        assert_eq!((out, gaps.held()), (195, 5));
        assert_eq!(gaps.filled(0), &want.0[..390]);
    }
}

#[test]
fn a_complex_sample_is_missing_with_either_of_its_parts() {
    let bank = fir_bank(vec![vec![1.0]], 1);
    let (real, imaginary) = ([1.0, f64::NAN, 3.0, 4.0], [10.0, 20.0, f64::INFINITY, 40.0]);
    let mut gaps = filler(&bank, 1, 2);
    assert_eq!(gaps.fill(&[&real, &imaginary].map(|part| Interleaved::new(part, 1).unwrap())), 3);
    assert_eq!([gaps.filled(0), gaps.filled(1)], [[1.0, 1.0, 4.0], [10.0, 10.0, 40.0]]);
    assert_eq!(gaps.marks(0..3), [0, 30, 30]);
    let summary = gaps.finish();
    assert_eq!((summary.count, summary.missing, summary.list[0].first), (1, 2, 1));
}

#[test]
fn marks_are_predicted_ratios() {
    // One sample is lost: its deviation of 0.1 counts times the tap, up to the most that it can cost.
    let bank = fir_bank(vec![vec![0.01, 0.0, 1.0]], 1);
    let mut gaps = filler(&bank, 2, 1);
    let (_, marks) = run(&mut gaps, &[1.0, 1.0, f64::NAN, 1.0, 1.0, 1.0], 6);
    // 10 log10(1 / (1e-8 + 1e-6)) and 10 log10(1 / (1e-8 + 1e-3)).
    assert_eq!(marks, [0, 0, 60, 0, 30, 0]);
}

#[test]
fn marks_come_later_by_the_latency_of_the_algorithm() {
    let bank = Bank { latency: 0, ..fir_bank(vec![vec![1.0; 64]], 1) };
    let options = Options { algorithm: Algorithm::OverlapSave, ..Options::default() };
    let plan = bank.plan(options).unwrap();
    let extra = plan.extra_latency();
    assert!(extra > 0);
    let estimator = Arc::new(Mean { reach: 1, samples: 1 });
    let mut gaps = GapFiller::new(&bank, &plan, 1, estimator);
    let mut samples = vec![1.0; 3 * extra + 200];
    samples[10] = f64::NAN;
    let (_, marks) = run(&mut gaps, &samples, 50);
    let marked: Vec<usize> = (0..marks.len()).filter(|&k| marks[k] > 0).collect();
    assert_eq!(marked, (extra + 10..extra + 74).collect::<Vec<_>>());
}

/// The definition: output p of frame k is affected if f_i[p + jM] is not zero for a missing x_i[k - j].
fn affected(taps: &[Vec<f64>], m: usize, samples: &[f64]) -> Vec<bool> {
    let n = taps.len();
    let touches = |k: usize, p: usize, i: usize| {
        let lags = (0..=k).take_while(|j| p + j * m < taps[i].len());
        lags.into_iter().any(|j| taps[i][p + j * m] != 0.0 && samples[(k - j) * n + i].is_nan())
    };
    let outputs = (0..samples.len() / n).flat_map(|k| (0..m).map(move |p| (k, p)));
    outputs.map(|(k, p)| (0..n).any(|i| touches(k, p, i))).collect()
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
        let mut gaps = filler(&fir_bank(taps.clone(), m), random.below(6), 1);
        let (_, marks) = run(&mut gaps, &samples, 1 + random.below(40));
        let marks: Vec<bool> = marks.iter().map(|mark| *mark > 0).collect();
        assert_eq!(marks, affected(&taps, m, &samples), "trial {trial}: {taps:?}");
    }
}

#[test]
fn a_response_of_a_recursion_ends_where_it_has_died_away() {
    let filter =
        StateMatrices { a: vec![vec![0.5]], b: vec![vec![1.0]], c: vec![vec![1.0]], d: vec![vec![0.0]] };
    let bank = Bank {
        filters: SynthesisFilters::StateSpace(filter),
        ..Bank::bare(SynthesisFilters::Fir(vec![vec![0.0]]), 1)
    };
    let mut samples = vec![1.0; 60];
    samples[10] = f64::NAN;
    let (_, marks) = run(&mut filler(&bank, 2, 1), &samples, 60);
    let marked: Vec<usize> = (0..marks.len()).filter(|&k| marks[k] > 0).collect();
    // 2^-23 > 1e-7 > 2^-24 of the largest.
    assert_eq!(marked, (11..=34).collect::<Vec<_>>());
}
