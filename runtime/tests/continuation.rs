//! Streams that go on by other coefficients, and the parts of complex samples.

use hybank_runtime::{
    Algorithm, Options, Output, PcmFormat, PcmFrames, PcmOutput, Plan, Precision, SampleLayout, Shape,
    StateSpace, Stream, SwapError,
};

const N: usize = 2;
const M: usize = 3;

/// Taps or samples between -1 and 1 that follow no simple rule.
fn numbers(count: usize, seed: usize) -> Vec<f64> {
    (0..count).map(|i| ((i + seed) * (i + 3 * seed) * 7919 % 2003) as f64 / 1001.0 - 1.0).collect()
}

fn plan(frames: usize, seed: usize, algorithm: Algorithm, precision: Precision) -> Plan {
    let taps: Vec<_> = (0..N).map(|i| numbers(frames * M, seed + 17 * i)).collect();
    Plan::from_taps(&taps, M, 0, Options { algorithm, precision, ..Options::default() }).unwrap()
}

fn process(stream: &mut Stream, input: &[f64]) -> Vec<f64> {
    let mut output = vec![0.0; input.len() / N * M];
    assert_eq!(stream.process(input, &mut output), Ok(output.len()));
    output
}

/// A stream of `plan` in place of `running`, at the same frame.
fn go_on(running: &Stream, plan: &Plan) -> Result<Stream, SwapError> {
    let mut next = Stream::new(plan);
    next.continue_from(running).map(|()| next)
}

/// Numbers of frames before the change: none, fewer than the filters reach, odd and even, many.
const BEFORE: [usize; 6] = [0, 1, 4, 7, 50, 501];

#[test]
fn new_filters_go_on_with_the_bits_of_their_own_stream() {
    for precision in [Precision::Single, Precision::Double] {
        for (k_old, k_new) in [(8, 8), (9, 9), (9, 5), (12, 7), (4, 9), (3, 16)] {
            let [from, to] =
                [(k_old, 1), (k_new, 5)].map(|(k, seed)| plan(k, seed, Algorithm::Direct, precision));
            for before in BEFORE {
                let input = numbers((before + 200) * N, 3);
                let mut running = Stream::new(&from);
                process(&mut running, &input[..before * N]);
                let mut next = go_on(&running, &to).unwrap();
                assert_eq!(next.position(), before as u64);
                let changed = process(&mut next, &input[before * N..]);
                let all = process(&mut Stream::new(&to), &input);
                let [kept, wanted] = [&from, &to].map(|plan| plan.history().unwrap());
                let settled = if wanted <= kept { 0 } else { wanted * M };
                assert_eq!(
                    changed[settled..],
                    all[before * M + settled..],
                    "{k_old} to {k_new} after {before}, {precision:?}"
                );
            }
        }
    }
}

#[test]
fn what_cannot_go_on_is_refused() {
    let direct = plan(4, 1, Algorithm::Direct, Precision::Single);
    let wider = Plan::from_taps(&vec![vec![1.0; 4]; N + 1], M, 0, Options::default()).unwrap();
    let double = plan(4, 1, Algorithm::Direct, Precision::Double);
    let overlap = plan(20, 1, Algorithm::OverlapSave, Precision::Single);
    let system = StateSpace {
        a: vec![vec![0.5]],
        b: vec![vec![1.0; N]],
        c: vec![vec![1.0]; M],
        d: vec![vec![0.0; N]; M],
    };
    let recursion =
        Plan::from_state_space(&system, Shape { channels: N, ratio: M }, 0, Options::default()).unwrap();
    let mut running = Stream::new(&direct);
    process(&mut running, &numbers(30 * N, 3));
    assert_eq!(
        go_on(&running, &wider).unwrap_err(),
        SwapError::Shape { from: Shape { channels: N, ratio: M }, to: Shape { channels: N + 1, ratio: M } }
    );
    for other in [&double, &overlap, &recursion] {
        let refused = SwapError::State { from: "direct", to: other.algorithm() };
        assert_eq!(go_on(&running, other).unwrap_err(), refused);
        assert!(go_on(&Stream::new(other), &direct).is_err());
    }
    assert!(go_on(&Stream::new(&recursion), &recursion).is_err());
}

/// Samples in a format, one each `container` bytes.
fn coded(samples: &[f64], format: PcmFormat, container: usize) -> Vec<u8> {
    let mut bytes = vec![0; samples.len() * container];
    for (slot, &sample) in bytes.chunks_exact_mut(container).zip(samples) {
        format.encode(sample, slot);
    }
    bytes
}

#[test]
fn complex_samples_are_two_streams_of_one_plan() {
    const FRAMES: usize = 300;
    for (algorithm, format, container) in [
        (Algorithm::Direct, PcmFormat::S16Le, 2),
        (Algorithm::Direct, PcmFormat::F32Le, 4),
        (Algorithm::Direct, PcmFormat::S24Le, 4),
        (Algorithm::OverlapSave, PcmFormat::F64Be, 8),
    ] {
        let plan = plan(9, 1, algorithm, Precision::Single);
        let layout = SampleLayout { format, container };
        let pairs = coded(&numbers(2 * FRAMES * N, 3), format, container);
        let input = PcmFrames { layout, channels: 2 * N, bytes: &pairs };
        let mut got = vec![0; 2 * FRAMES * M * format.bytes()];
        let mut output = PcmOutput::packed(format, &mut got);
        let mut clipped = 0;
        for part in [0, 1] {
            // The same part, sample after sample.
            let words = pairs.chunks_exact(container).skip(part).step_by(2).flatten().copied();
            let bytes: Vec<u8> = words.collect();
            let alone = PcmFrames { layout, channels: N, bytes: &bytes };
            let mut want = vec![0; FRAMES * M * format.bytes()];
            let mut wanted = PcmOutput::packed(format, &mut want);
            let written = Stream::new(&plan).run(&[alone].as_slice(), &mut wanted);
            assert_eq!(written, Ok(FRAMES * M));

            assert_eq!(input.part(part).frames(), FRAMES);
            output.select(part);
            assert_eq!(Stream::new(&plan).run(&[input.part(part)].as_slice(), &mut output), written);
            clipped += wanted.clipped;
            assert_eq!(output.clipped, clipped);
            let words = output.bytes.chunks_exact(format.bytes()).skip(part).step_by(2);
            assert!(words.eq(want.chunks_exact(format.bytes())), "{algorithm}, {format}, part {part}");
        }
        assert!(clipped > 0 || format.is_float());
    }
}
