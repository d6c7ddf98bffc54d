use super::super::{Pipeline, Settings};
use super::*;
use crate::bank::{Bank, SynthesisFilters};
use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use crate::random::Random;
use crate::runtime::{Interleaved, Options};
use crate::units::Seconds;
use std::sync::{Arc, Mutex};

const BLOCK: usize = 40;
const CHANNELS: usize = 2;
const RATIO: usize = 2;

/// The shifts at a frame: no two of them in a row are the same.
fn shifts(block: usize, is_late: bool) -> Vec<i64> {
    let k = 2 * block + usize::from(is_late);
    vec![[0, 1, 0, -1][k % 4], [3, 0, -4, 5, 1][k % 5]]
}

fn taps(seed: f64) -> Vec<Vec<f64>> {
    (0..CHANNELS).map(|i| (0..9).map(|n| (seed + (3 * n + 5 * i) as f64).sin()).collect()).collect()
}

/// Taps that differ from block to block and at frame 13 of a block, by what was in the block before last;
/// the channels are shifted as [`shifts`] says. The first sample of channel 2 of each block goes to `seen`.
fn changing(is_shifting: bool, seen: &Arc<Mutex<Vec<f64>>>) -> Retuner {
    let (seen, mut running, mut blocks) = (Arc::clone(seen), bank(), 0);
    let find = move |samples: &[Vec<f64>]| {
        assert!(samples.iter().all(|list| list.len() == BLOCK));
        seen.lock().unwrap().push(samples[1][0]);
        blocks += 1;
        let mut at = |frame: usize| {
            running.filters = SynthesisFilters::Fir(taps(samples[0][frame]));
            let stream = Stream::new(&running.plan(options())?);
            let shifts = if is_shifting { shifts(blocks + 1, frame > 0) } else { vec![0; CHANNELS] };
            Ok::<_, PipelineError>(Change { frame: frame as u64, stream, shifts })
        };
        Ok(vec![at(0)?, at(13)?])
    };
    Retuner::start(BLOCK, &[0.0; CHANNELS], find).unwrap()
}

fn options() -> Options {
    Options { precision: crate::runtime::Precision::Double, ..Options::default() }
}

fn bank() -> Bank {
    let bare = Bank::bare(SynthesisFilters::Fir(taps(0.0)), RATIO);
    Bank { delays: vec![Seconds(0.0); CHANNELS], ..bare }
}

fn bytes(samples: &[f64]) -> Vec<u8> {
    samples.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn run(samples: &[f64], cut: usize) -> (Vec<f64>, Vec<f64>) {
    run_with(samples, cut, false)
}

fn pipeline() -> Pipeline<'static> {
    let plan = bank().plan(options()).unwrap();
    Pipeline::new(&bank(), &plan, Settings::default(), PcmFormat::F64Le, false)
}

/// Pushes samples in pieces of so many frames.
fn push(pipeline: &mut Pipeline<'_>, samples: &[f64], cut: usize) -> Result<Vec<u8>, PipelineError> {
    let mut out = Vec::new();
    for piece in samples.chunks(cut * CHANNELS) {
        let layout = SampleLayout::packed(PcmFormat::F64Le);
        let bytes = bytes(piece);
        let recordings = [PcmFrames { layout, channels: CHANNELS, bytes: &bytes }];
        pipeline.push(&recordings, &mut |block| {
            out.extend_from_slice(block.samples);
            Ok(())
        })?;
    }
    Ok(out)
}

/// The output, flushed to as many frames as came in, and what was seen.
fn run_with(samples: &[f64], cut: usize, is_shifting: bool) -> (Vec<f64>, Vec<f64>) {
    let seen = Arc::default();
    let mut pipeline = pipeline().retuned_by(changing(is_shifting, &seen)).unwrap();
    let mut out = push(&mut pipeline, samples, cut).unwrap();
    let flushed = pipeline.flush((samples.len() / CHANNELS * RATIO) as u64, &mut |block| {
        out.extend_from_slice(block.samples);
        Ok(())
    });
    flushed.unwrap();
    pipeline.finish().unwrap();
    let values = out.chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap()));
    let seen = seen.lock().unwrap().clone();
    (values.collect(), seen)
}

fn noise(frames: usize) -> Vec<f64> {
    let mut random = Random(5);
    (0..frames * CHANNELS).map(|_| random.sample()).collect()
}

/// The taps that hold at a frame, by the definition of the blocks.
fn taps_at(samples: &[f64], frame: usize) -> Vec<Vec<f64>> {
    let (block, inside) = (frame / BLOCK, frame % BLOCK);
    if block < 2 {
        return taps(0.0);
    }
    let change = if inside < 13 { 0 } else { 13 };
    taps(samples[((block - 2) * BLOCK + change) * CHANNELS])
}

fn output(samples: &[f64], taps: &[Vec<f64>], frame: usize, p: usize) -> f64 {
    let term = |i: usize, j: usize| match frame.checked_sub(j) {
        Some(k) => taps[i].get(p + j * RATIO).copied().unwrap_or(0.0) * samples[k * CHANNELS + i],
        None => 0.0,
    };
    (0..CHANNELS).flat_map(|i| (0..5).map(move |j| (i, j))).map(|(i, j)| term(i, j)).sum()
}

/// Each output is that of the taps of its frame on all past samples: by the definition of the sum.
#[test]
fn filters_change_two_blocks_after_their_cause_with_the_history_kept() {
    let samples = noise(5 * BLOCK + 17);
    let (out, records) = run(&samples, 1000);
    for frame in 0..samples.len() / CHANNELS {
        let taps = taps_at(&samples, frame);
        for p in 0..RATIO {
            let want = output(&samples, &taps, frame, p);
            let have = out[frame * RATIO + p];
            assert!((have - want).abs() < 1e-12, "{frame} {p}: {have} {want}");
        }
    }
    let want: Vec<f64> = (0..5).map(|b| samples[b * BLOCK * CHANNELS + 1]).collect();
    assert_eq!(records, want);
}

/// Sample n of channel i; none beyond both ends.
fn sample(samples: &[f64], n: i64, i: usize) -> f64 {
    usize::try_from(n).ok().and_then(|n| samples.get(n * CHANNELS + i)).copied().unwrap_or(0.0)
}

/// Each output is that of the taps and the shifts of its frame: by the definition of the sum, over
/// samples that lie before the shifted ones too.
#[test]
fn channels_are_shifted_by_whole_frames() {
    let samples = noise(6 * BLOCK + 17);
    let (out, records) = run_with(&samples, 1000, true);
    assert_eq!(out.len(), samples.len());
    let shifts_at = |frame: usize| match frame / BLOCK {
        0 | 1 => vec![0; CHANNELS],
        block => shifts(block, frame % BLOCK >= 13),
    };
    // Of a block the other thread sees the samples with the shifts of its first frame.
    let seen = |frame: usize| {
        let shift = shifts_at(frame - frame % BLOCK);
        [0, 1].map(|i| sample(&samples, frame as i64 + shift[i], i))
    };
    for frame in 0..samples.len() / CHANNELS {
        let (block, inside) = (frame / BLOCK, frame % BLOCK);
        let cause = block.checked_sub(2).map(|b| b * BLOCK + if inside < 13 { 0 } else { 13 });
        let (taps, shift) = (taps(cause.map_or(0.0, |cause| seen(cause)[0])), shifts_at(frame));
        for p in 0..RATIO {
            let term = |i: usize, j: usize| {
                let tap = taps[i].get(p + j * RATIO).copied().unwrap_or(0.0);
                tap * sample(&samples, frame as i64 - j as i64 + shift[i], i)
            };
            let want: f64 =
                (0..CHANNELS).flat_map(|i| (0..5).map(move |j| (i, j))).map(|(i, j)| term(i, j)).sum();
            let have = out[frame * RATIO + p];
            assert!((have - want).abs() < 1e-12, "{frame} {p}: {have} {want}");
        }
    }
    let want: Vec<f64> = (0..6).map(|b| seen(b * BLOCK)[1]).collect();
    assert_eq!(records, want);
}

#[test]
fn the_cut_of_the_stream_changes_no_bit_of_shifted_channels() {
    let samples = noise(6 * BLOCK + 7);
    let whole = run_with(&samples, 10_000, true);
    for cut in [1, 7, 40, 41, 133] {
        assert_eq!(run_with(&samples, cut, true), whole, "{cut}");
    }
}

#[test]
fn the_cut_of_the_stream_changes_no_bit() {
    let samples = noise(6 * BLOCK + 7);
    let whole = run(&samples, 10_000);
    for cut in [1, 7, 40, 41, 133] {
        assert_eq!(run(&samples, cut), whole, "{cut}");
    }
}

/// What a change adds to the output at its frame is dF times the samples that it sees.
#[test]
fn a_change_makes_no_click_beyond_its_size() {
    let samples = noise(4 * BLOCK);
    let (out, _) = run(&samples, 1000);
    let norm = |list: &mut dyn Iterator<Item = f64>| list.map(|x| x * x).sum::<f64>().sqrt();
    for frame in [2 * BLOCK, 2 * BLOCK + 13, 3 * BLOCK, 3 * BLOCK + 13] {
        let (old, new) = (taps_at(&samples, frame - 1), taps_at(&samples, frame));
        let seen = norm(&mut samples[(frame - 4) * CHANNELS..(frame + 1) * CHANNELS].iter().copied());
        for p in 0..RATIO {
            let kept = output(&samples, &old, frame, p);
            let phase = |taps: &[Vec<f64>]| -> Vec<f64> {
                taps.iter().flat_map(|f| f.iter().skip(p).step_by(RATIO).copied()).collect()
            };
            let change = norm(&mut phase(&old).into_iter().zip(phase(&new)).map(|(a, b)| a - b));
            let step = (out[frame * RATIO + p] - kept).abs();
            assert!(step > 0.0 && step <= change * seen * (1.0 + 1e-12), "{step} {change} {seen}");
        }
    }
}

#[test]
fn a_thread_that_died_ends_the_run_with_an_error() {
    let samples = noise(5 * BLOCK);
    for cut in [7, 1000] {
        let find = |_: &[Vec<f64>]| -> Found { panic!("the search for changes fails") };
        let retuner = Retuner::start(BLOCK, &[0.0; CHANNELS], find).unwrap();
        let mut pipeline = pipeline().retuned_by(retuner).unwrap();
        let refused = push(&mut pipeline, &samples, cut).unwrap_err();
        assert!(matches!(refused, PipelineError::RetunerDied), "{refused}");
    }
    // In the last block too.
    let find = |_: &[Vec<f64>]| -> Found { panic!("the search for changes fails") };
    let mut pipeline = pipeline().retuned_by(Retuner::start(BLOCK, &[0.0; CHANNELS], find).unwrap()).unwrap();
    push(&mut pipeline, &samples[..BLOCK * CHANNELS], 1000).unwrap();
    assert!(matches!(pipeline.finish(), Err(PipelineError::RetunerDied)));
}

#[test]
fn filters_of_complex_samples_do_not_change_in_silence() {
    let plan = bank().plan(options()).unwrap();
    let complex = Pipeline::new(&bank(), &plan, Settings::default(), PcmFormat::F64Le, true);
    let refused = complex.retuned_by(changing(false, &Arc::default())).unwrap_err();
    assert!(matches!(refused, PipelineError::RetunedComplex));
}

fn idle(offsets: &[f64]) -> Retuner {
    Retuner::start(1 << 40, offsets, |_: &[Vec<f64>]| Ok(Vec::new())).unwrap()
}

fn shift(retuner: &mut Retuner, shifts: [i64; 2]) {
    retuner.channels.iter_mut().zip(shifts).for_each(|(channel, shift)| channel.shift = shift);
}

fn loaded(frames: &ShiftedFrames<'_>) -> Vec<[f64; 2]> {
    let mut numbers = vec![0.0; 2 * frames.frames()];
    frames.load(0, &mut numbers);
    numbers.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// Sample n of channel i is 100 i + n; without a signal the channels deliver -1 and -2.
fn counting() -> Retuner {
    let mut retuner = idle(&[-1.0, -2.0]);
    let samples: Vec<f64> = (0..6).flat_map(|n| [f64::from(n), f64::from(100 + n)]).collect();
    retuner.push(&Interleaved::new(&samples, 2).unwrap()).unwrap();
    retuner
}

#[test]
fn a_frame_holds_the_sample_that_lies_a_shift_further() {
    let mut retuner = counting();
    assert_eq!(retuner.ready(9), 6);
    shift(&mut retuner, [0, 2]);
    assert_eq!(retuner.ready(9), 4);
    retuner.shifts = vec![0, 3];
    assert_eq!(retuner.ready(9), 3);
    assert_eq!(loaded(&retuner.next(2)), [[0.0, 102.0], [1.0, 103.0]]);
    retuner.passed(2).unwrap();
    assert!(retuner.due().is_none());
    shift(&mut retuner, [0, -1]);
    assert_eq!(loaded(&retuner.next(1)), [[2.0, 101.0]]);
    assert_eq!(loaded(&retuner.frames(-1, 3, true)), [[-1.0, -2.0], [0.0, -2.0], [1.0, 100.0]]);
    (retuner.first, retuner.block, retuner.shifts) = (1, 2, vec![0, 1]);
    assert_eq!(retuner.block_samples(), [[1.0, 2.0], [102.0, 103.0]]);
}

#[test]
fn beyond_the_end_there_is_no_signal() {
    let mut retuner = counting();
    shift(&mut retuner, [0, 2]);
    retuner.passed(4).unwrap();
    assert_eq!(retuner.ready(9), 0);
    retuner.end();
    assert_eq!(retuner.ready(9), 2);
    assert_eq!(loaded(&retuner.next(2)), [[4.0, -2.0], [5.0, -2.0]]);
}

#[test]
fn what_is_missing_is_no_signal_in_the_history_only() {
    let mut retuner = idle(&[0.0, 0.5]);
    let samples = [1.0, f64::NAN, 2.0, f64::NAN];
    retuner.push(&Interleaved::new(&samples, 2).unwrap()).unwrap();
    assert_eq!(loaded(&retuner.frames(0, 1, true)), [[1.0, 0.5]]);
    assert!(loaded(&retuner.next(1))[0][1].is_nan());
}

/// A long stream does not grow.
#[test]
fn old_samples_are_forgotten() {
    let mut retuner = Retuner::start(4096, &[0.0], |_: &[Vec<f64>]| Ok(Vec::new())).unwrap();
    let block: Vec<f64> = (0..4096).map(f64::from).collect();
    for _ in 0..40 {
        retuner.push(&Interleaved::new(&block, 1).unwrap()).unwrap();
        retuner.passed(4096).unwrap();
    }
    assert!(retuner.channels[0].samples.len() < 4 * KEPT as usize);
    let mut recent = [0.0; 2];
    retuner.frames(retuner.position - 2, 2, true).load(0, &mut recent);
    assert_eq!(recent, [4094.0, 4095.0]);
}
