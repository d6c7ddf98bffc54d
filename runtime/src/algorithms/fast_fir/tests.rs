//! Fast FIR against the definition of the sum, and against three direct filters with the same bits.

use super::*;
use crate::tests::support::{
    Bank, Noise, by, definition, fir_bank, norm, precise, random_taps, recursive_bank, run, start, worst,
};
use crate::{Algorithm, Options, Precision, StateSpace, Stream};

fn options(precision: Precision) -> Options {
    precise(Algorithm::FastFir, precision)
}

fn fast(bank: &Bank) -> Stream {
    start(bank, by(Algorithm::FastFir)).unwrap()
}

/// A bank of `lags` lags per phase whose tap t is `tap(f, t)`.
fn mapped(taps: &[Vec<f64>], lags: usize, m: usize, tap: impl Fn(&[f64], usize) -> f64) -> Bank {
    fir_bank(taps.iter().map(|f| (0..lags * m).map(|t| tap(f, t)).collect()).collect(), m)
}

/// The scalar twin: three banks of every second lag, their outputs put together one by one.
fn twin<S: Sample>(taps: &[Vec<f64>], m: usize, input: &[S], options: Options) -> Vec<S> {
    let n = taps.len();
    let lags = phase_taps(taps, m);
    // Lag 2 j + parity of a filter.
    let tap = |f: &[f64], t: usize, parity: usize| {
        f.get((2 * (t / m) + parity) * m + t % m).copied().unwrap_or(0.0)
    };
    let even = mapped(taps, lags.div_ceil(2), m, |f, t| tap(f, t, 0));
    let odd = mapped(taps, lags / 2, m, |f, t| tap(f, t, 1));
    let mean = mapped(taps, lags.div_ceil(2), m, |f, t| (tap(f, t, 0) + tap(f, t, 1)) / 2.0);
    // A second frame that is not there does not matter.
    let mut padded = input.to_vec();
    padded.resize(input.len().next_multiple_of(2 * n), S::default());
    let frames: Vec<&[S]> = padded.chunks(n).collect();
    let half =
        |parity: usize| frames.iter().skip(parity).step_by(2).copied().flatten().copied().collect::<Vec<_>>();
    let (first, second) = (half(0), half(1));
    let means: Vec<S> = first.iter().zip(&second).map(|(&a, &b)| (a + b) * S::from_f64(0.5)).collect();
    let direct = Options { algorithm: Algorithm::Direct, ..options };
    let [a, b, c] = [(even, first), (odd, second), (mean, means)].map(|(bank, x)| run(&bank, direct, &x));
    let output = |t: usize| {
        let at = t / m / 2 * m + t % m;
        match t / m % 2 {
            0 => a[at] + at.checked_sub(m).map_or(S::default(), |before| b[before]),
            _ => S::from_f64(4.0) * c[at] - a[at] - b[at],
        }
    };
    (0..input.len() / n * m).map(output).collect()
}

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
            let want = twin(&taps, m, &wide, double);
            assert_eq!(run(&bank, double, &wide), want, "f64: N {n} M {m} {isa}");
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

/// For each output the sum over channels of the norm of the phase's filter times the norm of the inputs in
/// its history.
fn scales(taps: &[Vec<f64>], m: usize, input: &[f32]) -> Vec<f64> {
    let (n, history) = (taps.len(), phase_taps(taps, m).next_multiple_of(2));
    let scale = |t: usize| {
        let from = (t / m + 1).saturating_sub(history);
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

/// Inputs of which a sum of neighbours is a poor summand: a large constant, channels and frames of very
/// different size.
fn nasty_inputs(n: usize, frames: usize, noise: &mut Noise) -> [Vec<f32>; 4] {
    let white = noise.samples(n * frames);
    let scaled = |scale: &dyn Fn(usize, usize) -> f32| {
        white.iter().enumerate().map(|(t, x)| x * scale(t / n, t % n)).collect()
    };
    [
        white.clone(),
        white.iter().map(|x| x + 1000.0).collect(),
        scaled(&|_, i| [1e-9, 1e9, 1.0][i % 3]),
        scaled(&|frame, _| [1e9, 1e-9][frame % 2]),
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
                let case = format!("N {n} M {m} {count} taps, input {which}");
                // Taps, means and products are rounded, and three sums in place of one: a few eps each.
                assert!(fast < 6.0, "{case}: {fast} eps");
                assert!(direct < 3.0, "{case}: {direct} eps, direct");
            }
        }
    }
}

#[test]
fn the_error_of_noise_is_hardly_more_than_that_of_the_direct_algorithm() {
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
        let error = worst(&definition(&taps, m, &input), &out);
        assert!(error <= 1e-5 * 3.4e38, "N {n} M {m}: {error:e}");
        // And the same bits frame by frame, also after them.
        let mut stream = fast(&bank);
        let mut slow = vec![0.0; out.len()];
        for (x, y) in input.chunks(n).zip(slow.chunks_mut(m)) {
            stream.process(x, y).unwrap();
        }
        assert_eq!(slow, out, "N {n} M {m}");
    }
    let out = run(&fir_bank(vec![vec![0.019; 50]; 2], 2), options(Precision::Double), &[f64::MAX; 2 * 100]);
    assert!(out[100..].iter().all(|y| (y / f64::MAX - 0.95).abs() < 1e-12), "{out:?}");
}

#[test]
fn no_output_waits_for_the_second_frame_of_its_pair() {
    let mut noise = Noise(58);
    for (n, m) in [(1, 1), (1, 3), (3, 1), (2, 2), (5, 4)] {
        let bank = fir_bank(random_taps(n, 11 * m, &mut noise), m);
        let input = noise.samples(n * 501);
        let want = run(&bank, options(Precision::Single), &input);
        let mut stream = fast(&bank);
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
fn an_input_is_forgotten_after_the_history() {
    let mut noise = Noise(59);
    for (count, history) in [(2, 1), (3, 3), (16, 15), (17, 17)] {
        let bank = fir_bank(random_taps(1, count, &mut noise), 1);
        assert_eq!(fast(&bank).history(), Some(history));
        for index in 0..2 {
            let mut input = noise.samples(100);
            let want = run(&bank, options(Precision::Single), &input);
            input[index] += 1e4;
            let out = run(&bank, options(Precision::Single), &input);
            assert_eq!(out[index + history + 1..], want[index + history + 1..], "{count} taps");
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
        run(&bank, options(Precision::Single), &[1f32; 9]),
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
    let out = run(&bank, options(Precision::Single), &[1e-3f32, 0.0, 0.0, 1e-3, 0.0]);
    let want = [1.0, 1.0, 0.0, 1.0, 1.0].map(|y| y * 1e-3 * largest);
    assert!(
        out.iter().zip(want).all(|(y, want)| (f64::from(*y) - want).abs() < 1e-6 * 1e-3 * largest),
        "{out:?}"
    );
}
