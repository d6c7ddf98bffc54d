//! Fast FIR against the definition of the sum, and against three direct filters with the same bits.

use super::*;
use crate::tests::{
    Bank, Noise, definition, fir_bank, in_pieces, random_taps, recursive_bank, spans_agree, start,
};
use crate::{Algorithm, Options, PcmOutput, Precision, StateSpace, Stream, ThreadPool};
use crate::{PcmFormat, PcmFrames, SampleLayout};
use proptest::prelude::*;

fn options(precision: Precision) -> Options {
    Options { algorithm: Algorithm::FastFir, precision, ..Options::default() }
}

fn fast(bank: &Bank, precision: Precision) -> Stream {
    start(bank, options(precision)).unwrap()
}

fn run(bank: &Bank, options: Options, input: &[f32]) -> Vec<f32> {
    let mut stream = start(bank, options).unwrap();
    let mut out = vec![0.0; input.len() / stream.channels() * stream.ratio()];
    assert_eq!(stream.process(input, &mut out).unwrap(), out.len());
    out
}

/// In numbers of f64.
fn run_wide(bank: &Bank, options: Options, input: &[f64]) -> Vec<f64> {
    let mut stream = start(bank, options).unwrap();
    let mut out = vec![0.0; input.len() / stream.channels() * stream.ratio()];
    stream.process(input, &mut out).unwrap();
    out
}

/// The scalar twin: three banks of every second lag, their outputs put together one by one.
macro_rules! twin {
    ($name:ident, $sample:ty, $run:ident) => {
        fn $name(taps: &[Vec<f64>], m: usize, input: &[$sample], options: Options) -> Vec<$sample> {
            let n = taps.len();
            let lags = phase_taps(taps, m);
            // Lag 2 j + parity of a filter.
            let tap = |f: &[f64], t: usize, parity: usize| {
                f.get((2 * (t / m) + parity) * m + t % m).copied().unwrap_or(0.0)
            };
            let bank = |len: usize, of: &dyn Fn(&[f64], usize) -> f64| {
                fir_bank(taps.iter().map(|f| (0..len * m).map(|t| of(f, t)).collect()).collect(), m)
            };
            let even = bank(lags.div_ceil(2), &|f, t| tap(f, t, 0));
            let odd = bank(lags / 2, &|f, t| tap(f, t, 1));
            let mean = bank(lags.div_ceil(2), &|f, t| (tap(f, t, 0) + tap(f, t, 1)) / 2.0);
            // A second frame that is not there does not matter.
            let mut padded = input.to_vec();
            padded.resize(input.len().next_multiple_of(2 * n), 0.0);
            let ticks: Vec<&[$sample]> = padded.chunks(n).collect();
            let half = |parity: usize| ticks.iter().skip(parity).step_by(2).copied().flatten().copied();
            let means: Vec<$sample> = half(0).zip(half(1)).map(|(a, b)| (a + b) / 2.0).collect();
            let direct = Options { algorithm: Algorithm::Direct, ..options };
            let a = $run(&even, direct, &half(0).collect::<Vec<_>>());
            let b = $run(&odd, direct, &half(1).collect::<Vec<_>>());
            let c = $run(&mean, direct, &means);
            let mut out = vec![0.0; input.len() / n * m];
            for (t, y) in out.iter_mut().enumerate() {
                let (tick, at) = (t / m, t / m / 2 * m + t % m);
                *y = match tick % 2 {
                    0 => a[at] + at.checked_sub(m).map_or(0.0, |before| b[before]),
                    _ => 4.0 * c[at] - a[at] - b[at],
                };
            }
            out
        }
    };
}

twin!(twin, f32, run);
twin!(twin_wide, f64, run_wide);

#[test]
fn every_small_shape_has_the_bits_of_three_direct_filters() {
    let mut noise = Noise(51);
    for (n, m) in (1..=9).flat_map(|n| (1..=9).map(move |m| (n, m))).chain([(17, 2), (2, 17), (12, 12)]) {
        let taps = random_taps(n, m + 1 + (7 * n + 5 * m) % 60, &mut noise);
        let input = noise.samples(n * (1201 + n % 2));
        let wide: Vec<f64> = input.iter().map(|&x| f64::from(x)).collect();
        let bank = fir_bank(taps.clone(), m);
        for isa in Isa::available() {
            let single = Options { isa, ..options(Precision::Single) };
            assert_eq!(run(&bank, single, &input), twin(&taps, m, &input, single), "N {n} M {m} {isa}");
            let double = Options { isa, ..options(Precision::Double) };
            let want = twin_wide(&taps, m, &wide, double);
            assert_eq!(run_wide(&bank, double, &wide), want, "f64: N {n} M {m} {isa}");
        }
    }
}

#[test]
fn every_tap_count_has_the_bits_of_three_direct_filters() {
    let mut noise = Noise(52);
    for (n, m, count) in (3..=70).map(|count| (2, 2, count)).chain((2..=70).map(|count| (1, 1, count))) {
        let taps = random_taps(n, count, &mut noise);
        let input = noise.samples(n * (count + 9));
        let options = options(Precision::Single);
        let got = run(&fir_bank(taps.clone(), m), options, &input);
        assert_eq!(got, twin(&taps, m, &input, options), "N {n} M {m} {count} taps");
    }
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|x| x * x).sum::<f64>().sqrt()
}

/// For each output the sum over channels of the norm of the phase's filter times the norm of the inputs in its memory.
fn scales(taps: &[Vec<f64>], m: usize, input: &[f32]) -> Vec<f64> {
    let (n, memory) = (taps.len(), phase_taps(taps, m).next_multiple_of(2));
    let scale = |t: usize| {
        let from = (t / m + 1).saturating_sub(memory);
        let inputs =
            |i: usize| norm(input[from * n..(t / m + 1) * n].iter().skip(i).step_by(n).map(|&x| x.into()));
        let filter = |i: usize| norm(taps[i].iter().skip(t % m).step_by(m).copied());
        (0..n).map(|i| inputs(i) * filter(i)).sum()
    };
    (0..input.len() / n * m).map(scale).collect()
}

/// The largest error in units of eps times the scale of the output.
fn relative_error(taps: &[Vec<f64>], m: usize, input: &[f32], algorithm: Algorithm) -> f64 {
    let options = Options { algorithm, ..Options::default() };
    let got = run(&fir_bank(taps.to_vec(), m), options, input);
    let errors = definition(taps, m, input).into_iter().zip(got).zip(scales(taps, m, input));
    // An output of nothing but zeros has no error at all.
    errors.map(|((a, b), scale)| (a - f64::from(b)).abs() / scale.max(1e-300)).fold(0.0, f64::max)
        / f64::from(f32::EPSILON)
}

/// Inputs of which a sum of neighbours is a poor summand: a large constant, channels and frames of very different size.
fn nasty_inputs(n: usize, ticks: usize, noise: &mut Noise) -> [Vec<f32>; 4] {
    let white = noise.samples(n * ticks);
    let scaled = |scale: &dyn Fn(usize, usize) -> f32| {
        white.iter().enumerate().map(|(t, x)| x * scale(t / n, t % n)).collect()
    };
    [
        white.clone(),
        white.iter().map(|x| x + 1000.0).collect(),
        scaled(&|_, i| [1e-9, 1e9, 1.0][i % 3]),
        scaled(&|tick, _| [1e9, 1e-9][tick % 2]),
    ]
}

#[test]
fn the_error_is_within_the_stated_bound() {
    let mut noise = Noise(53);
    for (n, m) in (1..=8).flat_map(|n| (1..=8).map(move |m| (n, m))) {
        for count in [2 * m, 37 + m, 400] {
            let mut taps = random_taps(n, count, &mut noise);
            if count == 400 {
                // Values from 1e-9 to 1e9.
                taps.iter_mut().flatten().for_each(|tap| *tap *= 10f64.powf(9.0 * noise.next()));
            }
            for (which, input) in nasty_inputs(n, 150, &mut noise).iter().enumerate() {
                let [fast, direct] = [Algorithm::FastFir, Algorithm::Direct]
                    .map(|algorithm| relative_error(&taps, m, input, algorithm));
                let place = format!("N {n} M {m} {count} taps, input {which}");
                // Taps, means and products are rounded, and three sums in place of one: a few eps each.
                assert!(fast < 6.0, "{place}: {fast} eps");
                assert!(direct < 3.0, "{place}: {direct} eps, direct");
            }
        }
    }
}

#[test]
fn the_error_of_noise_is_hardly_more_than_that_of_the_direct_form() {
    let mut noise = Noise(54);
    for (n, m, lags) in [(1, 1, 16), (2, 2, 64), (4, 4, 16), (8, 8, 32)] {
        let taps = random_taps(n, m * lags, &mut noise);
        let taps: Vec<Vec<f64>> =
            taps.iter().map(|f| f.iter().map(|&tap| f64::from(tap as f32)).collect()).collect();
        let input = noise.samples(n * 3000);
        let want = definition(&taps, m, &input);
        let error = |algorithm| {
            let got = run(&fir_bank(taps.clone(), m), Options { algorithm, ..Options::default() }, &input);
            norm(want.iter().zip(got).map(|(a, b)| a - f64::from(b)))
        };
        let ratio = error(Algorithm::FastFir) / error(Algorithm::Direct);
        assert!((0.9..1.5).contains(&ratio), "N {n} M {m} K {lags}: {ratio}");
    }
}

#[test]
fn double_precision_is_double() {
    let mut noise = Noise(55);
    let taps = random_taps(4, 500, &mut noise);
    let input = noise.samples(4 * 1000);
    let wide: Vec<f64> = input.iter().map(|&x| f64::from(x)).collect();
    let out = run_wide(&fir_bank(taps.clone(), 4), options(Precision::Double), &wide);
    let worst = definition(&taps, 4, &input).iter().zip(&out).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // 6 eps as in f32; the sums of 500 products below 1 have norms below 500.
    assert!(worst < 6.0 * 500.0 * f64::EPSILON, "{worst:e}");
}

#[test]
fn a_channel_whose_taps_are_zero_leaves_no_trace() {
    let mut noise = Noise(56);
    let mut taps = random_taps(3, 40, &mut noise);
    taps[1].fill(0.0);
    let bank = fir_bank(taps, 2);
    let mut input = noise.samples(3 * 500);
    let want = run(&bank, options(Precision::Single), &input);
    input.iter_mut().skip(1).step_by(3).for_each(|x| *x *= 1e30);
    assert_eq!(run(&bank, options(Precision::Single), &input), want);
}

#[test]
fn an_impulse_anywhere_brings_out_the_taps_and_nothing_else() {
    let taps = vec![(1..=11).map(f64::from).collect(), (1..=7).map(|i| -f64::from(i)).collect()];
    let bank = fir_bank(taps.clone(), 3);
    for place in 0..2 * 30 {
        let mut input = vec![0.0; 2 * 40];
        input[place] = 1.0;
        // Small integers, halves and quarters: nothing is rounded.
        for (t, y) in run(&bank, options(Precision::Single), &input).into_iter().enumerate() {
            let tap = t.checked_sub(place / 2 * 3).and_then(|t| taps[place % 2].get(t));
            assert_eq!(f64::from(y), *tap.unwrap_or(&0.0), "impulse at {place}, output {t}");
        }
    }
}

#[test]
fn sums_that_overflow_do_not_make_the_output_overflow() {
    let mut noise = Noise(57);
    for (n, m, lags) in [(1, 1, 9), (2, 2, 8), (3, 2, 33), (1, 4, 20)] {
        // Twice the mean of the largest numbers passes them, and the products of a half do.
        let taps = vec![vec![0.9 / (n * lags) as f64; lags * m]; n];
        let bank = fir_bank(taps.clone(), m);
        let mut input = noise.samples(n * 700);
        input[n * 300..n * 400].fill(3.3e38);
        input[n * 500..n * 503].fill(-f32::MAX);
        let out = run(&bank, options(Precision::Single), &input);
        for (t, (a, b)) in definition(&taps, m, &input).iter().zip(&out).enumerate() {
            assert!((a - f64::from(*b)).abs() <= 1e-5 * 3.4e38, "N {n} M {m}, output {t}: {b} for {a}");
        }
        // And the same bits frame by frame, also after them.
        let mut stream = fast(&bank, Precision::Single);
        let mut slow = vec![0.0; out.len()];
        for (x, y) in input.chunks(n).zip(slow.chunks_mut(m)) {
            stream.process(x, y).unwrap();
        }
        assert_eq!(slow, out, "N {n} M {m}");
    }
    let wide = vec![f64::MAX; 2 * 100];
    let out = run_wide(&fir_bank(vec![vec![0.019; 50]; 2], 2), options(Precision::Double), &wide);
    assert!(out[100..].iter().all(|y| (y / f64::MAX - 0.95).abs() < 1e-12), "{out:?}");
}

#[test]
fn no_output_waits_for_the_second_tick_of_its_pair() {
    let mut noise = Noise(58);
    for (n, m) in [(1, 1), (1, 3), (3, 1), (2, 2), (5, 4)] {
        let bank = fir_bank(random_taps(n, 11 * m, &mut noise), m);
        let input = noise.samples(n * 501);
        let want = run(&bank, options(Precision::Single), &input);
        let mut stream = fast(&bank, Precision::Single);
        assert_eq!((stream.extra_latency(), stream.latency()), (0, bank.latency));
        assert_eq!(
            stream.plan().flush_frames(),
            start(&bank, Options::default()).unwrap().plan().flush_frames()
        );
        let mut out = vec![f32::NAN; want.len()];
        for (x, y) in input.chunks(n).zip(out.chunks_mut(m)) {
            assert_eq!(stream.process(x, y), Ok(m));
        }
        assert_eq!(out, want, "N {n} M {m}");
    }
}

#[test]
fn an_input_is_forgotten_after_the_memory() {
    let mut noise = Noise(59);
    for (count, memory) in [(2, 1), (3, 3), (16, 15), (17, 17)] {
        let bank = fir_bank(random_taps(1, count, &mut noise), 1);
        assert_eq!(fast(&bank, Precision::Single).history(), Some(memory));
        for place in 0..2 {
            let mut input = noise.samples(100);
            let want = run(&bank, options(Precision::Single), &input);
            input[place] += 1e4;
            let out = run(&bank, options(Precision::Single), &input);
            assert_eq!(out[place + memory + 1..], want[place + memory + 1..], "{count} taps");
        }
    }
}

#[test]
fn resets_fresh_streams_and_clones_have_the_bits_of_a_new_one() {
    let mut noise = Noise(60);
    for (n, m) in [(3, 4), (1, 2)] {
        let bank = fir_bank(random_taps(n, 50, &mut noise), m);
        let input = noise.samples(n * 777);
        let want = run(&bank, options(Precision::Single), &input);
        let mut stream = fast(&bank, Precision::Single);
        let mut out = vec![0.0; want.len()];
        for cut in [100, 101, 102, 103] {
            stream.process(&noise.samples(n * 333), &mut out).unwrap();
            stream.fresh().process(&input, &mut out).unwrap();
            assert_eq!(out, want);
            stream.reset();
            stream.process(&input[..n * cut], &mut out).unwrap();
            let mut twin = stream.clone();
            for stream in [&mut stream, &mut twin] {
                stream.process(&input[n * cut..], &mut out).unwrap();
                assert_eq!(out[..m * (777 - cut)], want[m * cut..]);
            }
        }
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut noise = Noise(61);
    let pools: Vec<_> = [1, 2, 3].into_iter().map(|threads| ThreadPool::new(threads).unwrap()).collect();
    // Long enough for several spans of a million multiply-adds each.
    for (n, m, taps, long) in [
        (1, 1, 33, 120_000),
        (1, 4, 64, 70_000),
        (2, 2, 24, 130_001),
        (3, 1, 41, 80_001),
        (5, 3, 50, 25_000),
        (2, 2, 9000, 40_000),
    ] {
        for precision in [Precision::Single, Precision::Double] {
            let bank = fir_bank(random_taps(n, taps, &mut noise), m);
            spans_agree(&bank, options(precision), &pools, long, &mut noise);
        }
    }
}

#[test]
fn filters_that_cannot_be_halved_are_refused() {
    let refused = |bank: &Bank| start(bank, options(Precision::Single)).unwrap_err();
    for taps in [vec![], vec![1.0], vec![1.0; 3]] {
        assert_eq!(refused(&fir_bank(vec![taps.clone(), taps], 3)), BuildError::TooShort { phase_taps: 1 });
    }
    assert!(
        refused(&fir_bank(vec![vec![1.0]], 1)).to_string().contains("at least 2, and these filters have 1")
    );
    // One filter is enough.
    let bank = fir_bank(vec![vec![1.0; 4], vec![], vec![2.0]], 3);
    assert_eq!(
        run(&bank, options(Precision::Single), &[1.0; 9]),
        [3.0, 1.0, 1.0, 4.0, 1.0, 1.0, 4.0, 1.0, 1.0]
    );
    let filter = StateSpace { a: vec![], b: vec![], c: vec![vec![]], d: vec![vec![1.0]] };
    let recursive = recursive_bank(filter);
    assert_eq!(refused(&recursive), BuildError::Recursive { algorithm: "fast-fir" });
    assert!(
        start(
            &recursive,
            Options { algorithm: Algorithm::Auto { added_latency: false }, ..Options::default() }
        )
        .is_ok()
    );
    assert!(matches!(refused(&fir_bank(vec![vec![0.0, 1e300]], 1)), BuildError::NotFinite { index: 1, .. }));
}

#[test]
fn the_largest_taps_have_a_mean() {
    let largest = f64::from(f32::MAX);
    let bank = fir_bank(vec![vec![largest; 2]], 1);
    let out = run(&bank, options(Precision::Single), &[1e-3, 0.0, 0.0, 1e-3, 0.0]);
    let want = [1.0, 1.0, 0.0, 1.0, 1.0].map(|y| y * 1e-3 * largest);
    assert!(
        out.iter().zip(want).all(|(y, want)| (f64::from(*y) - want).abs() < 1e-6 * 1e-3 * largest),
        "{out:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(96) })]

    #[test]
    fn cuts_do_not_change_a_bit(
        n in 1usize..10, m in 1usize..10, count in 1usize..60, seed: u64,
        cuts in prop::collection::vec(prop_oneof![0usize..20, 0usize..1200], 1..16), double: bool,
        lost in prop::collection::vec(0usize..100_000, 0..4),
    ) {
        let mut noise = Noise(seed);
        let precision = if double { Precision::Double } else { Precision::Single };
        let bank = fir_bank(random_taps(n, m + count, &mut noise), m);
        let mut stream = fast(&bank, precision);
        let mut input = noise.samples(n * cuts.iter().sum::<usize>());
        // Zero for what is lost gives the same.
        for place in &lost {
            if let Some(x) = input.get_mut(*place) { *x = 0.0; }
        }
        let mut whole = vec![0.0; input.len() / n * m];
        stream.process(&input, &mut whole).unwrap();
        stream.reset();
        for place in &lost {
            if let Some(x) = input.get_mut(*place) { *x = f32::NAN; }
        }
        let mut marked = vec![0.0; whole.len()];
        stream.process(&input, &mut marked).unwrap();
        prop_assert_eq!(marked.iter().zip(&whole).position(|(a, b)| a != b), None);
        let replaced = stream.replaced();
        prop_assert_eq!(replaced as usize, input.iter().filter(|x| x.is_nan()).count());
        stream.reset();
        let pieces = in_pieces(&mut stream, [n, m], &input, &cuts);
        prop_assert_eq!(pieces.iter().zip(&whole).position(|(a, b)| a != b), None);
        prop_assert_eq!(stream.replaced(), replaced);
    }

    #[test]
    fn bytes_give_the_same_samples(
        n in 1usize..5, m in 1usize..5, which in 0usize..12, seed: u64, ticks in 0usize..900,
    ) {
        let format = PcmFormat::ALL[which];
        let mut noise = Noise(seed);
        let bank = fir_bank(random_taps(n, 13, &mut noise), m);
        let mut bytes = vec![0; n * ticks * format.bytes()];
        for slot in bytes.chunks_exact_mut(format.bytes()) {
            format.encode(noise.next(), slot);
        }
        let input: Vec<f32> = bytes.chunks_exact(format.bytes()).map(|b| format.decode(b) as f32).collect();
        let want = run(&bank, options(Precision::Single), &input);
        let frames = PcmFrames { layout: SampleLayout::packed(format), channels: n, bytes: &bytes };
        let mut out = vec![0; 4 * want.len()];
        let mut output = PcmOutput { format: PcmFormat::F32Le, bytes: &mut out, clipped: 0 };
        fast(&bank, Precision::Single).process_pcm(&[frames], &mut output).unwrap();
        let got: Vec<f32> = out.chunks_exact(4).map(|b| PcmFormat::F32Le.decode(b) as f32).collect();
        prop_assert_eq!(got, want);
    }
}
