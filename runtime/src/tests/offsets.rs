//! A stream that subtracts offsets gives, bit for bit, what the samples without them give to a plan without
//! offsets.

use super::support::{FIR_ALGORITHMS, Noise, fir_bank, precise, random_taps, recursive_bank};
use crate::{
    Algorithm, BuildError, Nonlinearity, Options, PcmFormat, PcmFrames, PcmOutput, Plan, Planar, Precision,
    SampleLayout, SideBySide, StateMatrices, Stream,
};

/// Frames of a test: more than two batches of overlap-save with transforms of 64 frames.
const FRAMES: usize = 1500;

/// Dyadic, so that adding them to samples of a few bits is exact.
fn offsets(channels: usize) -> Vec<f64> {
    (0..channels).map(|i| [0.25, -0.5, 0.0, 0.125][i % 4]).collect()
}

/// Multiples of 1/256 from -0.5 to 0.5.
fn samples(channels: usize, noise: &mut Noise) -> Vec<f32> {
    (0..FRAMES * channels).map(|_| ((noise.next() * 128.0).round() / 256.0) as f32).collect()
}

/// The samples as the converters deliver them.
fn delivered(samples: &[f32], offsets: &[f64]) -> Vec<f32> {
    samples.iter().zip(offsets.iter().cycle()).map(|(&x, &offset)| x + offset as f32).collect()
}

/// Plans of every algorithm in both precisions, each with its twin that subtracts offsets.
fn plans(channels: usize, ratio: usize, noise: &mut Noise) -> Vec<[Plan; 2]> {
    let fir = fir_bank(random_taps(channels, 9 * ratio, noise), ratio);
    let order = 3;
    let recursion = recursive_bank(StateMatrices {
        a: (0..order).map(|i| (0..order).map(|j| 0.25 / (1 + i + j) as f64).collect()).collect(),
        b: random_taps(order, channels, noise),
        c: random_taps(ratio, order, noise),
        d: random_taps(ratio, channels, noise),
    });
    let ways = FIR_ALGORITHMS.map(|algorithm| (&fir, algorithm)).into_iter();
    ways.chain([(&recursion, Algorithm::Direct)])
        .flat_map(|(bank, way)| [Precision::Single, Precision::Double].map(|p| (bank, precise(way, p))))
        .map(|(bank, options)| {
            let plain = bank.plan(options).unwrap();
            [plain.clone(), plain.with_corrections(&offsets(channels), &[]).unwrap()]
        })
        .collect()
}

/// Output of interleaved frames in calls of so many frames, over and over, and of the flush after them.
fn outputs(plan: &Plan, input: &[f32], cuts: &[usize]) -> Vec<f32> {
    let (n, m) = (plan.channels(), plan.ratio());
    let mut stream = Stream::new(plan);
    let mut out = vec![0.0; (input.len() / n + plan.flush_frames()) * m];
    let (mut from, mut done) = (input, 0);
    for &cut in cuts.iter().cycle() {
        let part = &from[..from.len().min(cut * n)];
        done += stream.process(part, &mut out[done..]).unwrap();
        from = &from[part.len()..];
        if from.is_empty() {
            break;
        }
    }
    done += stream.flush(&mut &mut out[done..]).unwrap();
    assert_eq!((done, stream.replaced()), (out.len(), 0));
    out
}

#[test]
fn offsets_are_subtracted_whatever_the_algorithm_and_the_cuts() {
    let mut noise = Noise(5);
    for (n, m) in [(1, 1), (2, 2), (3, 4), (5, 2), (300, 1)] {
        let x = samples(n, &mut noise);
        let with = delivered(&x, &offsets(n));
        for [plain, subtracting] in plans(n, m, &mut noise) {
            let want = outputs(&plain, &x, &[FRAMES]);
            for cuts in [&[FRAMES][..], &[1, 7, 130], &[64, 640, 3]] {
                let got = outputs(&subtracting, &with, cuts);
                assert!(got == want, "{} {n} {m} {cuts:?}", plain.algorithm());
            }
        }
    }
}

#[test]
fn offsets_are_subtracted_in_every_form_of_the_samples() {
    let mut noise = Noise(6);
    let (n, m) = (3, 2);
    let x = samples(n, &mut noise);
    let with = delivered(&x, &offsets(n));
    for [plain, subtracting] in plans(n, m, &mut noise) {
        let mut want = vec![0f32; FRAMES * m];
        Stream::new(&plain).process(&x, &mut want).unwrap();
        let mut got = vec![0f32; FRAMES * m];
        let channels: Vec<Vec<f32>> =
            (0..n).map(|i| with.iter().skip(i).step_by(n).copied().collect()).collect();
        let planar: Vec<&[f32]> = channels.iter().map(Vec::as_slice).collect();
        Stream::new(&subtracting).run(&Planar::new(&planar).unwrap(), &mut got.as_mut_slice()).unwrap();
        assert!(got == want, "planar, {}", plain.algorithm());
        for (format, whole) in [PcmFormat::S16Le, PcmFormat::F32Be, PcmFormat::F64Le]
            .into_iter()
            .flat_map(|format| [(format, true), (format, false)])
        {
            let encode = |samples: &[f32]| -> Vec<u8> {
                let mut bytes = vec![0; samples.len() * format.bytes()];
                let slots = bytes.chunks_exact_mut(format.bytes());
                samples.iter().zip(slots).for_each(|(&x, slot)| {
                    format.encode(x.into(), slot);
                });
                bytes
            };
            let stored = if whole { vec![encode(&with)] } else { planar.iter().map(|x| encode(x)).collect() };
            let layout = SampleLayout::packed(format);
            let count = n / stored.len();
            let parts: Vec<_> =
                stored.iter().map(|bytes| PcmFrames { layout, channels: count, bytes }).collect();
            let mut bytes = vec![0; 4 * FRAMES * m];
            let mut output = PcmOutput::packed(PcmFormat::F32Le, &mut bytes);
            Stream::new(&subtracting).run(&SideBySide::new(parts), &mut output).unwrap();
            let got = bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()));
            // Doubles are rounded once, where they are stored.
            let close = got.zip(&want).all(|(a, &b)| (a - b).abs() <= 1e-6);
            assert!(close, "{format}, {}", plain.algorithm());
        }
    }
}

#[cfg(feature = "rayon")]
#[test]
fn offsets_are_subtracted_on_all_threads() {
    let mut noise = Noise(7);
    let bank = fir_bank(random_taps(2, 1024, &mut noise), 2);
    let x = noise.samples(2 * 40_000);
    let pool = crate::ThreadPool::new(3).unwrap();
    let plan = bank.plan(Options::default()).unwrap().with_corrections(&[0.3, -0.01], &[]).unwrap();
    let [mut alone, mut together] = [vec![0f32; 80_000], vec![0f32; 80_000]];
    Stream::new(&plan).process(&x, &mut alone).unwrap();
    let frames = crate::Interleaved::new(&x, 2).unwrap();
    Stream::new(&plan).run_parallel(&frames, &mut together.as_mut_slice(), &pool).unwrap();
    assert!(alone == together);
}

#[test]
fn a_sample_that_is_not_finite_is_zero_after_the_subtraction() {
    let mut noise = Noise(8);
    for [plain, subtracting] in plans(2, 3, &mut noise) {
        let mut x = samples(2, &mut noise);
        let mut with = delivered(&x, &offsets(2));
        for (index, value) in [(0, f32::NAN), (999, f32::INFINITY), (2000, f32::NEG_INFINITY)] {
            (x[index], with[index]) = (0.0, value);
        }
        let [mut want, mut got] = [vec![0f32; FRAMES * 3], vec![0f32; FRAMES * 3]];
        Stream::new(&plain).process(&x, &mut want).unwrap();
        let mut stream = Stream::new(&subtracting);
        stream.process(&with, &mut got).unwrap();
        assert!(got == want, "{}", plain.algorithm());
        assert_eq!(stream.replaced(), 3);
    }
}

#[test]
fn offsets_that_do_not_fit_are_refused() {
    let plan = || Plan::from_taps(&[vec![1.0], vec![1.0]], 1, 0, Options::default()).unwrap();
    let refused = plan().with_corrections(&[0.5], &[]).unwrap_err();
    assert_eq!(refused, BuildError::OffsetCount { offsets: 1, channels: 2 });
    for value in [f64::NAN, f64::INFINITY, 1e39] {
        let refused = plan().with_corrections(&[0.0, value], &[]).unwrap_err();
        assert!(matches!(refused, BuildError::NotFinite { index: 1, .. }), "{refused}");
    }
    assert!(plan().with_corrections(&[0.0, -0.0], &[]).unwrap().corrections().is_none());
}

/// By the definition of Chebyshev's polynomials, cos(k acos x), in both number types.
#[test]
fn nonlinearities_are_subtracted_at_the_sample_as_it_is() {
    let curves = [vec![1e-3, -2e-3, 0.0, 5e-4], vec![], vec![-4e-3]];
    let offsets = [0.01, 0.0, -0.02];
    let frames: Vec<f64> = (0..3 * 200).map(|n| 1.1 * (0.37 * f64::from(n)).sin()).collect();
    let straight = |(n, &x): (usize, &f64)| {
        let angle = x.clamp(-1.0, 1.0).acos();
        let curve: f64 = curves[n % 3].iter().zip(2..).map(|(a, k)| a * (f64::from(k) * angle).cos()).sum();
        x - curve - offsets[n % 3]
    };
    let expected: Vec<f64> = frames.iter().enumerate().map(straight).collect();
    let taps = vec![vec![0.5, 0.25, -0.125]; 3];
    let options = Options { precision: Precision::Double, ..Options::default() };
    let plain = Plan::from_taps(&taps, 2, 0, options).unwrap();
    let polynomials: Vec<_> = curves.iter().cloned().map(Nonlinearity::Polynomial).collect();
    let corrected = plain.clone().with_corrections(&offsets, &polynomials).unwrap();
    let run = |plan: Plan, frames: &[f64]| -> Vec<f64> {
        let mut output = vec![0.0; 400];
        Stream::new(&plan).process(frames, &mut output).unwrap();
        output
    };
    let (got, want) = (run(corrected, &frames), run(plain, &expected));
    assert!(got.iter().zip(&want).all(|(got, want)| (got - want).abs() < 1e-15), "{got:?} {want:?}");
}

/// Each code of 4 bits has its own entry, whatever rounding has done to it, and what is beyond that of the
/// end. Another channel has a polynomial.
#[test]
fn tables_are_subtracted_by_the_code_of_a_sample() {
    let table: Vec<f64> = (0..16).map(|code| 1e-3 * f64::from(code * code)).collect();
    let curves = [Nonlinearity::Table { table: table.clone() }, Nonlinearity::Polynomial(vec![0.01])];
    let taps = vec![vec![1.0]; 2];
    for precision in [Precision::Single, Precision::Double] {
        let options = Options { precision, ..Options::default() };
        let plan = Plan::from_taps(&taps, 1, 0, options).unwrap();
        let plan = plan.with_corrections(&[0.0, 0.0], &curves).unwrap();
        for code in -12..12 {
            let x = f64::from(code) / 8.0 * (1.0 - 1e-7);
            let entry = table[(code + 8).clamp(0, 15) as usize];
            let mut output = [0.0];
            Stream::new(&plan).process(&[x, 0.5], &mut output).unwrap();
            // T_2(0.5) is -0.5.
            let want = x - entry + 0.505;
            assert!((output[0] - want).abs() < 1e-6 && curves[0].at(x) == entry, "{code}: {output:?} {want}");
        }
    }
}
