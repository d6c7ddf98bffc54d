//! NaN, infinity and sums that overflow: replaced, counted and never passed on.

use super::support::{Bank, Filters, Noise, fir_bank, random_taps, rotation_bank, run, start};
use crate::{Options, PcmFormat, PcmFrames, PcmOutput, SampleLayout};

/// The outputs of calls of at most so many frames, and the count of samples that were replaced.
fn counted(bank: &Bank, input: &[f32], call: usize) -> (Vec<f32>, u64) {
    let mut stream = start(bank, Options::default()).unwrap();
    let (n, m) = (stream.channels(), stream.ratio());
    let mut out = vec![0.0; input.len() / n * m];
    for (x, y) in input.chunks(call * n).zip(out.chunks_mut(call * m)) {
        stream.process(x, y).unwrap();
    }
    (out, stream.replaced())
}

#[test]
fn what_is_not_finite_is_found_wherever_it_is() {
    let mut noise = Noise(77);
    for (n, m) in (1..=9).flat_map(|n| (1..=5).map(move |m| (n, m))) {
        for lags in [1, 2, 3, 7, 20] {
            // Every second filter is zero: what it multiplies by nothing must be found all the same.
            let mut taps = random_taps(n, lags * m, &mut noise);
            taps.iter_mut().step_by(2).for_each(|f| f.fill(0.0));
            let bank = fir_bank(taps, m);
            let mut input = noise.samples(n * 420);
            let index = (noise.0 >> 33) as usize % input.len();
            input[index] = 0.0;
            let want = run(&bank, Options::default(), &input);
            input[index] = if lags % 2 == 0 { f32::NAN } else { f32::NEG_INFINITY };
            for call in [420, 60, 7] {
                let (out, replaced) = counted(&bank, &input, call);
                assert_eq!((&out, replaced), (&want, 1), "N {n} M {m} K {lags}, sample {index}, {call}");
            }
        }
    }
}

/// Frames of samples that are not finite: at random distances of up to `most` frames, at the beginning and
/// the end, and about the ends of the blocks that the direct algorithm filters at once.
fn bad_frames(frames: usize, most: usize, noise: &mut Noise) -> Vec<usize> {
    let mut bad: Vec<usize> =
        [0, 1, 95, 96, frames - 1].into_iter().filter(|&frame| frame < frames).collect();
    let mut frame = 0;
    while frame < frames {
        bad.push(frame);
        frame += 1 + (noise.next().abs() * most as f64) as usize;
    }
    bad.extend((1..frames / 96).map(|block| 96 * block - 1));
    if most > 300 {
        bad.retain(|frame| frame % 5 < 2);
    }
    bad
}

#[test]
fn what_is_not_finite_is_zero_at_any_distance() {
    let mut noise = Noise(78);
    // With histories within a block, and longer than one.
    let shapes = [
        (1, 1, 1),
        (1, 1, 30),
        (1, 4, 9),
        (2, 2, 12),
        (3, 2, 5),
        (3, 4, 18),
        (4, 4, 16),
        (5, 3, 40),
        (8, 6, 130),
        (2, 1, 400),
    ];
    for ((n, m, lags), most) in shapes.into_iter().flat_map(|shape| [3, 60, 700].map(|most| (shape, most))) {
        let bank = fir_bank(random_taps(n, lags * m, &mut noise), m);
        let mut input = noise.samples(n * 9000);
        let places: Vec<usize> =
            bad_frames(9000, most, &mut noise).into_iter().map(|frame| frame * n + frame % n).collect();
        places.iter().for_each(|&place| input[place] = 0.0);
        let want = run(&bank, Options::default(), &input);
        for (index, &place) in places.iter().enumerate() {
            input[place] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][index % 3];
        }
        let count = input.iter().filter(|x| !x.is_finite()).count() as u64;
        for call in [9000, 2111, 700, 64, 17] {
            let (out, replaced) = counted(&bank, &input, call);
            let different = out.iter().zip(&want).position(|(a, b)| a.to_bits() != b.to_bits());
            let case = format!("N {n} M {m} K {lags}, up to {most} frames apart, calls of {call} frames");
            assert_eq!((different, replaced), (None, count), "{case}");
        }
    }
}

#[test]
fn what_is_not_finite_never_reaches_a_state() {
    let mut noise = Noise(7);
    for bank in [rotation_bank(), fir_bank(random_taps(1, 9, &mut noise), 1)] {
        let mut input = noise.samples(100);
        input[40] = 0.0;
        let want = run(&bank, Options::default(), &input);
        input[40] = f32::NAN;
        let mut stream = start(&bank, Options::default()).unwrap();
        let mut out = vec![0.0; want.len()];
        stream.process(&input, &mut out).unwrap();
        assert_eq!((out, stream.replaced(), stream.state_resets()), (want, 1, 0));
    }
}

#[test]
fn a_recursion_that_overflows_starts_again_and_is_counted() {
    let mut bank = rotation_bank();
    if let Filters::StateSpace(filter) = &mut bank.filters {
        filter.a = vec![vec![1e200, 0.0], vec![0.0, 0.5]];
    }
    let mut stream = start(&bank, Options::default()).unwrap();
    let mut input = [0.0; crate::algorithms::recursive::BLOCK];
    input[0] = 1.0;
    stream.process(&input, &mut [0.0; 3 * crate::algorithms::recursive::BLOCK]).unwrap();
    assert_eq!(stream.state_resets(), 1);
    let mut out = [0.0; 3];
    stream.process(&[2.0], &mut out).unwrap();
    assert_eq!(out, [1.0, 0.0, -2.0]);
}

#[test]
fn bytes_that_are_not_finite_become_zero_and_are_counted_and_clipped_samples_once() {
    let converted = |samples: &[f32], format: PcmFormat| {
        let bytes: Vec<u8> = samples.iter().flat_map(|x| x.to_le_bytes()).collect();
        let mut stream = start(&fir_bank(vec![vec![1.0]], 1), Options::default()).unwrap();
        let mut out = vec![0; samples.len() * format.bytes()];
        let mut output = PcmOutput::packed(format, &mut out);
        let frames = PcmFrames { layout: SampleLayout::packed(PcmFormat::F32Le), channels: 1, bytes: &bytes };
        stream.run(&frames, &mut output).unwrap();
        let counts = [output.clipped, stream.replaced()];
        (out, counts)
    };
    let input = [1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2.0];
    let (out, [_, replaced]) = converted(&input, PcmFormat::F32Le);
    assert_eq!((out, replaced), ([1f32, 0.0, 0.0, 0.0, 2.0].map(f32::to_le_bytes).concat(), 3));
    let mut samples = vec![0.25f32; 100];
    (samples[3], samples[50], samples[60]) = (2.0, f32::NAN, f32::INFINITY);
    assert_eq!(converted(&samples, PcmFormat::S16Le).1, [1, 2]);
}
