//! Streams that go on by other coefficients, and complex streams against two real ones.

use hybank_runtime::{Algorithm, ComplexStream, Options, Plan, Precision, StateSpace, Stream};

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

/// Numbers of frames before the swap: none, fewer than the filters reach, odd and even, many.
const BEFORE: [usize; 6] = [0, 1, 4, 7, 50, 501];

#[test]
fn swapped_filters_go_on_with_the_bits_of_their_own_stream() {
    let forms = [Algorithm::Direct, Algorithm::FastFir];
    for (old, new) in forms.iter().flat_map(|old| forms.map(|new| (*old, new))) {
        for precision in [Precision::Single, Precision::Double] {
            for (k_old, k_new) in [(8, 8), (9, 9), (9, 5), (12, 7), (4, 9), (3, 16)] {
                let (from, to) = (plan(k_old, 1, old, precision), plan(k_new, 5, new, precision));
                for before in BEFORE {
                    let input = numbers((before + 200) * N, 3);
                    let mut running = Stream::new(&from);
                    process(&mut running, &input[..before * N]);
                    running.swap(&to).unwrap();
                    assert_eq!(running.position(), before as u64);
                    let swapped = process(&mut running, &input[before * N..]);
                    let all = process(&mut Stream::new(&to), &input);
                    let [kept, wanted] = [&from, &to].map(|plan| plan.history().unwrap());
                    let settled = if wanted <= kept { 0 } else { wanted * M };
                    assert_eq!(
                        swapped[settled..],
                        all[before * M + settled..],
                        "{old:?} {k_old} to {new:?} {k_new} after {before}, {precision:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn overlap_save_has_taken_over_after_one_batch() {
    let algorithm = Algorithm::OverlapSave { transform: Some(64) };
    let [from, to] = [1, 5].map(|seed| plan(20, seed, algorithm, Precision::Single));
    for before in BEFORE {
        let input = numbers((before + 300) * N, 3);
        let mut running = Stream::new(&from);
        process(&mut running, &input[..before * N]);
        running.swap(&to).unwrap();
        let swapped = process(&mut running, &input[before * N..]);
        let all = process(&mut Stream::new(&to), &input);
        let settled = to.alignment() * M;
        assert_eq!(swapped[settled..], all[before * M + settled..], "after {before}");
    }
}

#[test]
fn what_cannot_go_on_is_refused_and_left_alone() {
    let direct = plan(4, 1, Algorithm::Direct, Precision::Single);
    let wider = Plan::from_taps(&vec![vec![1.0; 4]; N + 1], M, 0, Options::default()).unwrap();
    let overlap = plan(20, 1, Algorithm::OverlapSave { transform: None }, Precision::Single);
    let recursion = |pole: f64| {
        let system = StateSpace {
            a: vec![vec![pole]],
            b: vec![vec![1.0; N]],
            c: vec![vec![1.0]; M],
            d: vec![vec![0.0; N]; M],
        };
        Plan::from_state_space(&system, [N, M], 0, Options::default()).unwrap()
    };
    let input = numbers(30 * N, 3);
    for other in [&wider, &overlap, &recursion(0.5)] {
        let mut stream = Stream::new(&direct);
        process(&mut stream, &input);
        let mut twin = stream.clone();
        assert!(stream.swap(other).is_err());
        assert_eq!(process(&mut stream, &input), process(&mut twin, &input));
    }
    let mut stream = Stream::new(&recursion(0.5));
    assert!(stream.swap(&recursion(0.25)).is_err());
}

#[test]
fn complex_streams_are_two_real_ones() {
    for algorithm in [Algorithm::Direct, Algorithm::FastFir, Algorithm::OverlapSave { transform: Some(64) }] {
        let plan = plan(9, 1, algorithm, Precision::Single);
        let parts = [3, 8].map(|seed| numbers(300 * N, seed));
        let input: Vec<_> = parts[0].iter().zip(&parts[1]).map(|(&re, &im)| [re, im]).collect();
        let mut stream = ComplexStream::new(&plan);
        let mut output = vec![[0.0; 2]; 300 * M];
        for (input, output) in input.chunks(7 * N).zip(output.chunks_mut(7 * M)) {
            stream.process(input, output).unwrap();
        }
        let mut tail = vec![[0.0; 2]; plan.flush_frames() * M];
        assert_eq!(stream.flush(&mut tail), Ok(tail.len()));
        output.extend(tail);
        for (part, samples) in parts.iter().enumerate() {
            let mut real = Stream::new(&plan);
            let mut expected = process(&mut real, samples);
            let mut tail = vec![0.0; plan.flush_frames() * M];
            real.flush(&mut tail[..]).unwrap();
            expected.extend(tail);
            let given: Vec<_> = output.iter().map(|sample| sample[part]).collect();
            assert_eq!(given, expected, "{algorithm:?}, part {part}");
        }
    }
}
