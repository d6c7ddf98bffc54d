//! The worst case of a call, whatever the input holds: how much it filters, and what becomes of denormals.
//! Multiply-adds are counted, because times would depend on the machine.

use super::support::{
    Bank, FIR_ALGORITHMS, Noise, by, fir_bank, precise, random_taps, recursive_bank, rotation_bank, run,
    start,
};
use crate::algorithms::recursive::{BLOCK, NEGLIGIBLE_STATE};
use crate::simd::{group_lanes, work};
use crate::{Algorithm, Options, Precision, Sample, StateMatrices, Stream};

const FRAMES: usize = 1280;
/// Frames per call.
const CALLS: [usize; 6] = [1, 2, 5, 64, 320, FRAMES];
/// N, M, K; calls of the last one are filtered in several segments.
const SHAPES: [(usize, usize, usize); 5] = [(1, 1, 9), (2, 2, 8), (3, 2, 33), (4, 4, 16), (8, 5, 12)];

/// What an input holds besides numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Nasty {
    AllNan,
    /// Of changing sign.
    AllInfinite,
    /// In one sample of every k-th frame.
    Nan(usize),
    NanAtCallBegin,
    NanAtCallEnd,
    /// All of them, or every second one.
    Denormal(usize),
    /// The largest numbers, whose sums overflow.
    Largest,
    /// All of these in turn.
    Everything,
}

impl Nasty {
    const ALL: [Self; 12] = [
        Self::AllNan,
        Self::AllInfinite,
        Self::Nan(2),
        Self::Nan(7),
        Self::Nan(64),
        Self::Nan(97),
        Self::NanAtCallBegin,
        Self::NanAtCallEnd,
        Self::Denormal(1),
        Self::Denormal(2),
        Self::Largest,
        Self::Everything,
    ];

    /// False if some sums of finite samples overflow.
    fn sums_are_finite(self) -> bool {
        !matches!(self, Self::Largest | Self::Everything)
    }

    /// Sample `index` of an input of N channels in calls of `call` frames, in place of the number `x`.
    fn sample<S: Sample>(self, x: f64, index: usize, [n, call]: [usize; 2]) -> S {
        let (denormal, largest) =
            if size_of::<S>() == 4 { (1e-40, f64::from(f32::MAX)) } else { (1e-310, f64::MAX) };
        let (frame, first) = (index / n, index.is_multiple_of(n));
        let value = match self {
            Self::AllNan => f64::NAN,
            Self::AllInfinite => f64::INFINITY.copysign(x),
            Self::Nan(k) if first && frame.is_multiple_of(k) => f64::NAN,
            Self::NanAtCallBegin if first && frame.is_multiple_of(call) => f64::NAN,
            Self::NanAtCallEnd if first && frame % call == call - 1 => f64::NAN,
            Self::Denormal(k) if index.is_multiple_of(k) => denormal * x,
            Self::Largest => largest.copysign(x),
            Self::Everything => [f64::NAN, f64::NEG_INFINITY, denormal, largest, x][index % 5],
            _ => x,
        };
        S::from_f64(value)
    }
}

/// Multiply-adds of each call of `call` frames, and all outputs.
fn work_of<S: Sample>(stream: &mut Stream, input: &[S], call: usize) -> (Vec<usize>, Vec<S>) {
    let (n, m) = (stream.channels(), stream.ratio());
    let mut out = vec![S::default(); FRAMES * m];
    let calls = input.chunks(call * n).zip(out.chunks_mut(call * m));
    let work = calls.map(|(x, y)| work::of(|| assert_eq!(stream.process(x, y), Ok(y.len())))).collect();
    (work, out)
}

/// Multiply-adds of the calls of a stream for numbers and for each nasty input.
fn each_work<S: Sample>(stream: &Stream, mut check: impl FnMut(Nasty, usize, &[usize], &[usize])) {
    let n = stream.channels();
    for call in CALLS {
        let mut noise = Noise(70);
        let numbers: Vec<f64> = (0..n * FRAMES).map(|_| noise.next()).collect();
        let clean: Vec<S> = numbers.iter().map(|&x| S::from_f64(x)).collect();
        let (usual, _) = work_of(&mut Stream::new(stream.plan()), &clean, call);
        for nasty in Nasty::ALL {
            let sample = |(index, &x): (usize, &f64)| nasty.sample::<S>(x, index, [n, call]);
            let input: Vec<S> = numbers.iter().enumerate().map(sample).collect();
            let (work, out) = work_of(&mut Stream::new(stream.plan()), &input, call);
            if nasty.sums_are_finite() {
                assert!(out.iter().all(|y| y.is_finite()), "{nasty:?} in calls of {call} frames");
            }
            check(nasty, call, &usual, &work);
        }
    }
}

/// For streams of either precision and samples of either type: in memory as the kernels take them, or to be
/// converted.
fn every_work(bank: &Bank, algorithm: Algorithm, mut check: impl FnMut(Nasty, usize, &[usize], &[usize])) {
    for precision in [Precision::Single, Precision::Double] {
        let stream = start(bank, precise(algorithm, precision)).unwrap();
        each_work::<f32>(&stream, &mut check);
        each_work::<f64>(&stream, &mut check);
    }
}

#[test]
fn the_direct_algorithm_filters_a_frame_twice_at_most() {
    let mut noise = Noise(71);
    for (n, m, k) in SHAPES {
        let bank = fir_bank(random_taps(n, m * k, &mut noise), m);
        let mut twice = false;
        every_work(&bank, Algorithm::Direct, |nasty, call, usual, work| {
            let case = format!("N {n} M {m} K {k}, {nasty:?} in calls of {call} frames");
            let is_bounded = |(usual, work): (&usize, &usize)| (*usual..=2 * usual).contains(work);
            assert!(usual.iter().zip(work).all(is_bounded), "{case}");
            if matches!(nasty, Nasty::Denormal(_)) {
                assert_eq!(usual, work, "{case}");
            }
            twice |= usual.iter().zip(work).any(|(&usual, &work)| usual > 0 && work == 2 * usual);
        });
        assert!(twice, "the bound is reached");
    }
}

#[test]
fn overlap_save_filters_a_frame_once() {
    let mut noise = Noise(74);
    // Batches are longer than the input with one channel and one phase.
    for (n, m, k) in SHAPES.into_iter().skip(1) {
        let bank = fir_bank(random_taps(n, m * k, &mut noise), m);
        every_work(&bank, Algorithm::OverlapSave, |nasty, call, usual, work| {
            assert!(usual.iter().any(|&work| work > 0));
            assert_eq!(usual, work, "N {n} M {m} K {k}, {nasty:?} in calls of {call} frames");
        });
    }
}

/// NaN in one of a thousand frames: few others share a window with it.
#[test]
fn the_direct_algorithm_filters_few_frames_again_for_one_that_is_not_finite() {
    let mut noise = Noise(72);
    for (n, m, k) in SHAPES {
        let mut stream = start(&fir_bank(random_taps(n, m * k, &mut noise), m), Options::default()).unwrap();
        for call in [64, 1000, 16_000] {
            let mut input = noise.samples(n * call);
            let mut out = vec![0.0; m * call];
            let mut work = |input: &[f32]| work::of(|| assert!(stream.process(input, &mut out).is_ok()));
            let usual = work(&input);
            // Blocks of one channel are the longest ones, and two samples in a block would be too many.
            let places = (n * call / 2..n * call).step_by(1000 * n.max(2));
            let bad = places.clone().count();
            places.for_each(|place| input[place] = f32::NAN);
            let again = (work(&input) - usual) * call / usual;
            // The frames of the windows, and those that fill a vector at each end.
            let few = bad * k.min(call / 2)..=bad * (k + 48);
            assert!(few.contains(&again), "N {n} M {m} K {k}: {again} of {call} frames");
        }
    }
}

#[test]
fn recursions_filter_a_frame_once() {
    let dense = StateMatrices {
        a: (0..5).map(|i| (0..5).map(|j| 0.1 / (1 + i + j) as f64).collect()).collect(),
        b: vec![vec![1.0, -1.0]; 5],
        c: vec![vec![1.0; 5]; 3],
        d: vec![vec![0.5, 0.25]; 3],
    };
    for bank in [rotation_bank(), recursive_bank(dense)] {
        every_work(&bank, Algorithm::Direct, |nasty, call, usual, work| {
            assert!(usual.iter().all(|&work| work > 0));
            assert_eq!(usual, work, "{nasty:?} in calls of {call} frames");
        });
    }
}

#[test]
fn the_direct_algorithm_does_the_multiply_adds_of_the_definition() {
    let mut noise = Noise(73);
    for (n, m, k) in SHAPES {
        let bank = fir_bank(random_taps(n, m * k, &mut noise), m);
        // Windows of other than 1, 2 or 4 channels are padded to whole groups.
        let group = group_lanes::<f32>();
        let window = if n < group && n.is_power_of_two() { n * k } else { (n * k).next_multiple_of(group) };
        let mut stream = start(&bank, Options::default()).unwrap();
        for call in CALLS {
            let (work, _) = work_of(&mut stream, &noise.samples(n * FRAMES), call);
            assert!(work.iter().all(|&work| work == call * window * m), "N {n} M {m} K {k}: {work:?}");
        }
    }
}

/// On every processor that has a mode for it.
#[test]
#[cfg(all(any(target_arch = "x86_64", target_arch = "aarch64"), not(miri)))]
fn denormals_count_as_zero_and_the_least_normal_numbers_stay() {
    let (tiny, narrow) = (f64::MIN_POSITIVE, f32::MIN_POSITIVE);
    let bank = fir_bank(vec![vec![1.0, -2.0]], 1);
    assert_eq!(run(&bank, by(Algorithm::Direct), &[narrow, 0.0, 0.0])[..2], [narrow, -2.0 * narrow]);
    assert_eq!(run(&bank, by(Algorithm::Direct), &[narrow / 2.0, 0.0, 0.0])[..2], [0.0, 0.0]);
    let options = precise(Algorithm::Direct, Precision::Double);
    assert_eq!(run(&bank, options, &[tiny, 0.0, 0.0])[..2], [tiny, -2.0 * tiny]);
    assert_eq!(run(&bank, options, &[tiny / 2.0, 0.0, 0.0])[..2], [0.0, 0.0]);
    let bank = fir_bank(vec![vec![1.0; 3]], 1);
    assert_eq!(run(&bank, by(FIR_ALGORITHMS[1]), &[narrow / 2.0; 40]), [0.0; 40]);
}

/// The state of x[k + 1] = pole x[k] + u[k] after an impulse.
fn fading(pole: f64, frames: usize) -> Vec<f64> {
    let filter =
        StateMatrices { a: vec![vec![pole]], b: vec![vec![1.0]], c: vec![vec![1.0]], d: vec![vec![0.0]] };
    let mut input = vec![0.0; frames];
    input[0] = 1.0;
    run(&recursive_bank(filter), Options::default(), &input)
}

/// States below the limit are there between two flushes only.
#[test]
fn a_state_that_fades_away_is_denormal_for_less_than_a_block() {
    for pole in [0.01f64, 0.1, 0.5, -0.5, 0.9, 0.99] {
        let above = (NEGLIGIBLE_STATE.ln() / pole.abs().ln()) as usize;
        let gone = above + 2 * BLOCK;
        let states = fading(pole, gone + 200);
        let small = states.iter().filter(|x| (1e-320..NEGLIGIBLE_STATE).contains(&x.abs())).count();
        assert!(small < BLOCK, "pole {pole}: {small} frames");
        assert!(states[gone..].iter().all(|&x| x == 0.0), "pole {pole}");
        assert!(states[1..above].iter().all(|&x| x != 0.0), "pole {pole}");
    }
}
