//! Every kernel on calls of a few frames against the definition. The calls are small enough for Miri
//! (`tools/miri.sh`), which checks each load and store of the portable kernels.

use super::support::{FIR_ALGORITHMS, definition, fir_bank, recursive_bank, state_space_definition, worst};
use crate::{
    Isa, Options, PcmFormat, PcmFrames, PcmOutput, Plan, Precision, SampleLayout, StateMatrices, Stream,
};

/// Numbers between -1 and 1 that follow no simple rule.
fn samples(count: usize) -> Vec<f64> {
    (0..count).map(|i| (i * i * 7919 % 2003) as f64 / 1001.0 - 1.0).collect()
}

/// The outputs of a stream for two calls of unequal length, without those that the algorithm adds at the
/// beginning; zeros after the input bring out the last ones.
fn run(plan: &Plan, input: &[f64]) -> Vec<f64> {
    let (n, m) = (plan.channels(), plan.ratio());
    let frames = input.len() / n + plan.extra_latency() / m;
    let mut input = input.to_vec();
    input.resize(frames * n, 0.0);
    let mut out = vec![0.0; frames * m];
    let mut stream = Stream::new(plan);
    let first = frames / 3;
    stream.process(&input[..first * n], &mut out[..first * m]).unwrap();
    stream.process(&input[first * n..], &mut out[first * m..]).unwrap();
    out.split_off(plan.extra_latency())
}

/// N and M of FIR filters. Miri takes a thousand times as long: there each number of lanes per frame and of
/// phases once.
fn shapes() -> Vec<(usize, usize)> {
    if cfg!(miri) {
        return vec![(1, 1), (1, 4), (2, 3), (3, 2), (4, 1), (8, 5)];
    }
    [1, 2, 3, 4, 8, 9].into_iter().flat_map(|n| [1, 2, 3, 4, 5].map(|m| (n, m))).collect()
}

#[test]
fn fir_kernels_follow_the_definition() {
    let frames = if cfg!(miri) { 12 } else { 40 };
    for (n, m) in shapes() {
        let taps: Vec<Vec<f64>> = samples(n * 4 * m).chunks(4 * m).map(<[f64]>::to_vec).collect();
        let input = samples(n * frames);
        let want = definition(&taps, m, &input);
        let bank = fir_bank(taps, m);
        for isa in Isa::available() {
            for (precision, eps) in [(Precision::Single, 3e-5), (Precision::Double, 1e-13)] {
                for algorithm in FIR_ALGORITHMS {
                    let plan = bank.plan(Options { isa, precision, algorithm }).unwrap();
                    let error = worst(&want, &run(&plan, &input));
                    assert!(error < eps, "N {n} M {m} {isa} {precision:?} {algorithm:?}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn recursions_follow_the_definition() {
    // One pole for each of three states, and the same states mixed, which no parallel algorithm has.
    let poles = [0.5, -0.25, 0.75];
    for mixed in [0.0, 0.125] {
        let row = |i: usize| (0..3).map(|j| if i == j { poles[i] } else { mixed }).collect();
        let matrix =
            |rows: usize, cols: usize| samples(rows * cols).chunks(cols).map(<[f64]>::to_vec).collect();
        let filter =
            StateMatrices { a: (0..3).map(row).collect(), b: matrix(3, 2), c: matrix(2, 3), d: matrix(2, 2) };
        let input = samples(2 * 70);
        let want = state_space_definition(&filter, &input);
        let bank = recursive_bank(filter);
        for isa in Isa::available() {
            let plan = bank.plan(Options { isa, ..Options::default() }).unwrap();
            let error = worst(&want, &run(&plan, &input));
            assert!(error < 1e-13, "mixed {mixed} {isa}: {error:e}");
        }
    }
}

/// Bytes as they lie in files, to and from the kernels that convert them.
#[test]
fn pcm_follows_the_samples_in_memory() {
    let bank = fir_bank(vec![vec![0.5, -0.25]; 3], 1);
    let plan = bank.plan(Options { isa: Isa::portable(), ..Options::default() }).unwrap();
    for format in PcmFormat::ALL {
        let bytes: Vec<u8> = (0..3 * 21 * format.bytes()).map(|i| (i * 37 % 61) as u8).collect();
        let input: Vec<f32> =
            bytes.chunks_exact(format.bytes()).map(|bytes| format.decode(bytes) as f32).collect();
        let mut want = vec![0f32; 21];
        Stream::new(&plan).process(&input, &mut want).unwrap();
        let mut expected = vec![0; 21 * format.bytes()];
        for (slot, &y) in expected.chunks_exact_mut(format.bytes()).zip(&want) {
            format.encode(f64::from(y), slot);
        }
        let mut out = vec![0; expected.len()];
        let mut output = PcmOutput::packed(format, &mut out);
        let frames = PcmFrames { layout: SampleLayout::packed(format), channels: 3, bytes: &bytes };
        Stream::new(&plan).run(&frames, &mut output).unwrap();
        assert_eq!(out, expected, "{format}");
    }
}
