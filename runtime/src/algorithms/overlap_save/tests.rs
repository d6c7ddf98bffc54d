//! Overlap-save against the definition of the sum, and against a scalar twin with the same bits.

use super::*;
use crate::tests::{Bank, Noise, definition, fir_bank, in_pieces, random_taps, recursive_bank, start};
use crate::{Algorithm, Options, PcmOutput, Precision};
use crate::{PcmFormat, PcmFrames, SampleLayout};
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::ops::{Add, Mul, Sub};

/// A number of the twin.
trait Real: Copy + Default + PartialEq + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    fn fused(self, factor: Self, sum: Self) -> Self;
    fn of(value: f64) -> Self;
    fn negative(self) -> Self {
        Self::default() - self
    }
}

macro_rules! real {
    ($type:ty) => {
        impl Real for $type {
            fn fused(self, factor: Self, sum: Self) -> Self {
                self.mul_add(factor, sum)
            }

            fn of(value: f64) -> Self {
                value as Self
            }
        }
    };
}

real!(f32);
real!(f64);

/// The scalar twin: complex numbers one by one, transforms by recursion and in natural order.
#[derive(Clone, Copy)]
struct Twin {
    fused: bool,
}

impl Twin {
    fn fma<T: Real>(self, a: T, b: T, c: T) -> T {
        if self.fused { a.fused(b, c) } else { a * b + c }
    }

    fn product<T: Real>(self, x: [T; 2], w: [T; 2]) -> [T; 2] {
        let re = self.fma(x[1].negative(), w[1], x[0] * w[0]);
        [re, self.fma(x[0], w[1], x[1] * w[0])]
    }

    /// x times the conjugate of w.
    fn product_back<T: Real>(self, x: [T; 2], w: [T; 2]) -> [T; 2] {
        let im = self.fma(x[0].negative(), w[1], x[1] * w[0]);
        [self.fma(x[1], w[1], x[0] * w[0]), im]
    }

    fn factor<T: Real>(j: usize, span: usize) -> [T; 2] {
        let (sin, cos) = (TAU * j as f64 / span as f64).sin_cos();
        [T::of(cos), T::of(-sin)]
    }

    fn butterfly<T: Real>([a, b, c, d]: [[T; 2]; 4]) -> [[T; 2]; 4] {
        let add = |x: [T; 2], y: [T; 2]| [x[0] + y[0], x[1] + y[1]];
        let sub = |x: [T; 2], y: [T; 2]| [x[0] - y[0], x[1] - y[1]];
        let (even, odd, far, [re, im]) = (add(a, c), add(b, d), sub(a, c), sub(b, d));
        [add(even, odd), [far[0] + im, far[1] - re], sub(even, odd), [far[0] - im, far[1] + re]]
    }

    fn forward<T: Real>(self, x: &[[T; 2]]) -> Vec<[T; 2]> {
        let len = x.len();
        match x {
            [_] => return x.to_vec(),
            [a, b] => return vec![[a[0] + b[0], a[1] + b[1]], [a[0] - b[0], a[1] - b[1]]],
            _ => {}
        }
        let mut parts = vec![vec![]; 4];
        for j in 0..len / 4 {
            let y = Self::butterfly([x[j], x[j + len / 4], x[j + len / 2], x[j + 3 * len / 4]]);
            for (r, y) in y.into_iter().enumerate() {
                parts[r].push(if r * j == 0 { y } else { self.product(y, Self::factor(r * j, len)) });
            }
        }
        let parts: Vec<_> = parts.iter().map(|part| self.forward(part)).collect();
        (0..len).map(|f| parts[f % 4][f / 4]).collect()
    }

    fn inverse<T: Real>(self, x: &[[T; 2]]) -> Vec<[T; 2]> {
        let len = x.len();
        if len <= 2 {
            return self.forward(x);
        }
        let part = |r: usize| x.iter().skip(r).step_by(4).copied().collect::<Vec<_>>();
        let parts: Vec<_> = (0..4).map(|r| self.inverse(&part(r))).collect();
        let mut out = vec![[T::default(); 2]; len];
        for j in 0..len / 4 {
            let y = std::array::from_fn(|r| match r * j {
                0 => parts[r][j],
                _ => self.product_back(parts[r][j], Self::factor(r * j, len)),
            });
            let [first, second, third, fourth] = Self::butterfly(y);
            for (r, y) in [first, fourth, third, second].into_iter().enumerate() {
                out[j + r * len / 4] = y;
            }
        }
        out
    }

    /// The outputs of whole pairs of blocks.
    fn stream<T: Real>(self, taps: &[Vec<f64>], ratio: usize, len: usize, input: &[T]) -> Vec<T> {
        let (n, lags) = (taps.len(), phase_taps(taps, ratio));
        let block = len - (lags - 1);
        let spectrum = |f: &[f64], p: usize| -> Vec<[T; 2]> {
            let tap =
                |k: usize| f.get(p + k * ratio).filter(|_| k < lags).map_or(0.0, |tap| tap / len as f64);
            let h: Vec<[f64; 2]> = (0..len).map(|k| [tap(k), 0.0]).collect();
            self.forward(&h).into_iter().map(|h| h.map(T::of)).collect()
        };
        let spectra: Vec<Vec<_>> =
            taps.iter().map(|f| (0..ratio).map(|p| spectrum(f, p)).collect()).collect();
        let at = |tick: isize, i: usize| match usize::try_from(tick) {
            Ok(tick) => input.get(tick * n + i).copied().unwrap_or_default(),
            Err(_) => T::default(),
        };
        let mut out = vec![];
        for first in (0..input.len() / n).step_by(2 * block) {
            let x: Vec<_> = (0..n)
                .map(|i| {
                    let tick = |t: usize| (first + t) as isize - (lags - 1) as isize;
                    let frame = |t| [at(tick(t), i), at(tick(t + block), i)];
                    self.forward(&(0..len).map(frame).collect::<Vec<_>>())
                })
                .collect();
            let y: Vec<_> = (0..ratio)
                .map(|p| {
                    let sum = |f: usize| {
                        let mut sums = [T::default(); 4];
                        for i in 0..n {
                            // Upper frequencies take the spectrum of the lower ones.
                            let (h, [re, im]) = (spectra[i][p][f.min(len - f)], x[i][f]);
                            let pairs = [(h[0], re), (h[1], im), (h[0], im), (h[1], re)];
                            sums = std::array::from_fn(|s| self.fma(pairs[s].0, pairs[s].1, sums[s]));
                        }
                        let [rr, ii, ri, ir] = sums;
                        if f <= len / 2 { [rr - ii, ri + ir] } else { [rr + ii, ri - ir] }
                    };
                    self.inverse(&(0..len).map(sum).collect::<Vec<_>>())
                })
                .collect();
            for (part, t) in (0..2).flat_map(|part| (lags - 1..len).map(move |t| (part, t))) {
                out.extend((0..ratio).map(|p| y[p][t][part]));
            }
        }
        out
    }
}

fn options(len: usize, precision: Precision) -> Options {
    Options { algorithm: Algorithm::OverlapSave { transform: Some(len) }, precision, ..Options::default() }
}

/// All outputs of an input, the first of them for its first frame.
fn run(bank: &Bank, options: Options, input: &[f32]) -> Vec<f32> {
    let mut stream = start(bank, options).unwrap();
    let late = stream.extra_latency();
    let mut padded = input.to_vec();
    padded.resize(input.len() + late / stream.ratio() * stream.channels(), 0.0);
    let mut out = vec![0.0; padded.len() / stream.channels() * stream.ratio()];
    assert_eq!(stream.process(&padded, &mut out).unwrap(), out.len());
    out.split_off(late)
}

#[test]
fn every_small_shape_has_the_bits_of_the_scalar_twin() {
    let mut noise = Noise(41);
    for (n, m) in (1..=9).flat_map(|n| (1..=9).map(move |m| (n, m))).chain([(17, 2), (2, 17), (12, 12)]) {
        let taps = random_taps(n, 1 + (7 * n + 5 * m) % 40, &mut noise);
        let len = phase_taps(&taps, m).next_power_of_two().max(16) << (n % 3);
        let input = noise.samples(n * (3 * len + 7));
        let wide: Vec<f64> = input.iter().map(|&x| f64::from(x)).collect();
        for isa in Isa::available() {
            let twin = Twin { fused: isa.fuses() };
            let want = twin.stream(&taps, m, len, &input);
            let single = Options { isa, ..options(len, Precision::Single) };
            let got = run(&fir_bank(taps.clone(), m), single, &input);
            assert_eq!(got, want[..got.len()], "N {n} M {m} F {len} {isa}");
            let want: Vec<f32> = twin.stream(&taps, m, len, &wide).iter().map(|&y| y as f32).collect();
            let double = Options { isa, ..options(len, Precision::Double) };
            let got = run(&fir_bank(taps.clone(), m), double, &input);
            assert_eq!(got, want[..got.len()], "f64: N {n} M {m} F {len} {isa}");
        }
    }
}

/// The largest error in units of eps log2 F times the norm of a phase's filters times the norm of the inputs of two
/// blocks.
fn relative_error(taps: &[Vec<f64>], m: usize, len: usize, input: &[f32], eps: f64, got: &[f32]) -> f64 {
    let n = taps.len();
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    let filters = (0..m)
        .map(|p| norm(&mut taps.iter().flat_map(|f| f.iter().skip(p).step_by(m).copied())))
        .fold(0.0, f64::max);
    let inputs =
        input.chunks(n * 2 * len).map(|x| norm(&mut x.iter().map(|&x| f64::from(x)))).fold(0.0, f64::max);
    let scale = eps * f64::from(len.ilog2()) * filters * inputs;
    let worst = definition(taps, m, input).into_iter().zip(got).map(|(a, &b)| (a - f64::from(b)).abs());
    worst.fold(0.0, f64::max) / scale
}

#[test]
fn the_error_is_within_the_stated_bound() {
    let mut noise = Noise(42);
    for (n, m) in (1..=8).flat_map(|n| (1..=8).map(move |m| (n, m))) {
        for count in [1, 37, 400] {
            let mut taps = random_taps(n, count, &mut noise);
            if count == 400 {
                // Values from 1e-9 to 1e9.
                taps.iter_mut().flatten().for_each(|tap| *tap *= 10f64.powf(9.0 * noise.next()));
            }
            for len in [0, 2].map(|more| phase_taps(&taps, m).next_power_of_two().max(16) << more) {
                let input = noise.samples(n * (2 * len + 50));
                let got = run(&fir_bank(taps.clone(), m), options(len, Precision::Single), &input);
                let error = relative_error(&taps, m, len, &input, f64::from(f32::EPSILON), &got);
                assert!(error < 1.0, "N {n} M {m} {count} taps F {len}: {error}");
            }
        }
    }
}

#[test]
fn double_precision_is_double() {
    let mut noise = Noise(43);
    let taps = random_taps(4, 500, &mut noise);
    let input = noise.samples(4 * 3000);
    let wide: Vec<f64> = input.iter().map(|&x| f64::from(x)).collect();
    let mut stream = start(&fir_bank(taps.clone(), 4), options(512, Precision::Double)).unwrap();
    let mut out = vec![0.0; wide.len()];
    stream.process(&wide, &mut out).unwrap();
    let want = definition(&taps, 4, &input);
    let worst =
        want.iter().zip(&out[stream.extra_latency()..]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // eps log2 F ||h|| ||x||, as for f32: norms of 500 taps and of 1024 frames of numbers below 1.
    assert!(worst < f64::EPSILON * 9.0 * 500f64.sqrt() * 4096f64.sqrt(), "{worst:e}");
}

#[test]
fn an_impulse_anywhere_brings_out_the_taps_and_nothing_else() {
    let taps = vec![(1..=11).map(f64::from).collect(), (1..=7).map(|i| -f64::from(i)).collect()];
    let bank = fir_bank(taps.clone(), 3);
    for place in 0..2 * 130 {
        let mut input = vec![0.0; 2 * 140];
        input[place] = 1.0;
        let out = run(&bank, options(16, Precision::Single), &input);
        for (t, y) in out.iter().enumerate() {
            let tap = t.checked_sub(place / 2 * 3).and_then(|t| taps[place % 2].get(t));
            assert!((f64::from(*y) - tap.unwrap_or(&0.0)).abs() < 1e-5, "impulse at {place}: {y} at {t}");
        }
    }
}

#[test]
fn long_prime_and_empty_filters_work() {
    let mut noise = Noise(44);
    for count in [0, 1, 2, 509, 4001] {
        let taps = random_taps(2, count, &mut noise);
        let input = noise.samples(2 * 3000);
        let bank = fir_bank(taps.clone(), 2);
        let algorithm = Algorithm::OverlapSave { transform: None };
        let got = run(&bank, Options { algorithm, ..Options::default() }, &input);
        let scale = 1e-6 * (count as f64 + 1.0).sqrt() * 100.0;
        for (t, (a, b)) in definition(&taps, 2, &input).iter().zip(&got).enumerate() {
            assert!((a - f64::from(*b)).abs() < scale, "{count} taps, output {t}: {b} for {a}");
        }
    }
}

#[test]
fn input_that_makes_a_transform_overflow_does_not_make_the_output_overflow() {
    let taps = vec![vec![0.25; 40], vec![-0.25; 40]];
    // Alternating signs: each output is small, the spectrum at half the rate is not.
    let input: Vec<f32> = (0..2 * 500).map(|i| if i / 2 % 2 == 0 { 2e38 } else { -2e38 }).collect();
    let got = run(&fir_bank(taps.clone(), 2), options(64, Precision::Single), &input);
    for (a, b) in definition(&taps, 2, &input).iter().zip(&got) {
        assert!((a - f64::from(*b)).abs() < 1e-5 * 2e38, "{b} for {a}");
    }
}

#[test]
fn resets_fresh_streams_and_clones_have_the_bits_of_a_new_one() {
    let mut noise = Noise(45);
    let bank = fir_bank(random_taps(3, 50, &mut noise), 4);
    let options = options(32, Precision::Single);
    let input = noise.samples(3 * 777);
    let mut stream = start(&bank, options).unwrap();
    let mut want = vec![0.0; 4 * 777];
    stream.process(&input, &mut want).unwrap();
    let mut out = vec![0.0; want.len()];
    stream.fresh().process(&input, &mut out).unwrap();
    assert_eq!(out, want);
    stream.reset();
    stream.process(&input[..3 * 100], &mut out).unwrap();
    let mut twin = stream.clone();
    for stream in [&mut stream, &mut twin] {
        stream.process(&input[3 * 100..], &mut out).unwrap();
        assert_eq!(out[..4 * 677], want[4 * 100..]);
    }
}

#[test]
fn latency_is_exact_and_flushing_brings_everything_out() {
    let mut noise = Noise(46);
    for (n, m, count) in [(1, 1, 9), (2, 3, 30), (5, 2, 64)] {
        let taps = random_taps(n, count, &mut noise);
        let bank = fir_bank(taps.clone(), m);
        let mut stream = start(&bank, options(64, Precision::Single)).unwrap();
        assert_eq!(stream.latency(), bank.latency + stream.extra_latency());
        assert_eq!(stream.history(), Some(phase_taps(&taps, m) - 1));
        let input = noise.samples(n * 150);
        let mut out = vec![0.0; m * 150];
        stream.process(&input, &mut out).unwrap();
        let mut tail = vec![0.0; m * stream.plan().flush_frames()];
        stream.process(&vec![0.0; n * stream.plan().flush_frames()], &mut tail).unwrap();
        out.extend(tail);
        let (late, all) = out.split_at(stream.extra_latency());
        assert!(late.iter().all(|&y| y == 0.0));
        assert!(all.len() >= m * 150 && all.len() < m * 150 + m + bank.latency);
        assert_eq!(all[..m * 150], run(&bank, options(64, Precision::Single), &input));
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut noise = Noise(47);
    let bank = fir_bank(random_taps(2, 90, &mut noise), 2);
    let mut one = start(&bank, options(128, Precision::Single)).unwrap();
    let mut many = one.fresh();
    let input = noise.samples(2 * 20_000);
    let mut out = [vec![0.0; 2 * 20_000], vec![0.0; 2 * 20_000]];
    one.process(&input, &mut out[0]).unwrap();
    many.process_parallel(&input, &mut out[1], &crate::ThreadPool::new(3).unwrap()).unwrap();
    assert_eq!(out[0], out[1]);
}

#[test]
fn recursive_banks_have_no_transforms() {
    let filter = crate::StateSpace { a: vec![], b: vec![], c: vec![vec![]], d: vec![vec![1.0]] };
    let bank = recursive_bank(filter);
    let refused = |algorithm| start(&bank, Options { algorithm, ..Options::default() }).err();
    assert_eq!(
        refused(Algorithm::OverlapSave { transform: None }),
        Some(BuildError::Recursive { algorithm: "overlap-save" })
    );
    assert_eq!(refused(Algorithm::Auto { added_latency: true }), None);
}

#[test]
fn spectra_that_would_fill_the_memory_are_refused_or_not_chosen() {
    let taps = vec![vec![1.0; 1024]; 1024];
    let bank = fir_bank(taps, 1024);
    let made = |algorithm| start(&bank, Options { algorithm, ..Options::default() });
    let len = 1 << 20;
    let refused = BuildError::Spectra { channels: 1024, ratio: 1024, len };
    assert_eq!(made(Algorithm::OverlapSave { transform: Some(len) }).err(), Some(refused));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn cuts_do_not_change_a_bit(
        n in 1usize..10, m in 1usize..10, count in 1usize..60, more in 0usize..3, seed: u64,
        cuts in prop::collection::vec(prop_oneof![0usize..20, 0usize..900], 1..16), double: bool,
        lost in prop::collection::vec(0usize..100_000, 0..4),
    ) {
        let mut noise = Noise(seed);
        let precision = if double { Precision::Double } else { Precision::Single };
        let taps = random_taps(n, count, &mut noise);
        let len = phase_taps(&taps, m).next_power_of_two().max(16) << more;
        let bank = fir_bank(taps, m);
        let mut stream = start(&bank, options(len, precision)).unwrap();
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
    fn bytes_give_the_same_samples(n in 1usize..5, m in 1usize..5, seed: u64, ticks in 0usize..900) {
        let mut noise = Noise(seed);
        let bank = fir_bank(random_taps(n, 13, &mut noise), m);
        let input = noise.samples(n * ticks);
        let mut stream = start(&bank, options(16, Precision::Single)).unwrap();
        let mut want = vec![0.0; m * ticks];
        stream.process(&input, &mut want).unwrap();
        stream.reset();
        let bytes: Vec<u8> = input.iter().flat_map(|x| x.to_le_bytes()).collect();
        let frames = PcmFrames { layout: SampleLayout::packed(PcmFormat::F32Le), channels: n, bytes: &bytes };
        let mut out = vec![0; 4 * want.len()];
        let mut output = PcmOutput { format: PcmFormat::F32Le, bytes: &mut out, clipped: 0 };
        stream.process_pcm(&[frames], &mut output).unwrap();
        let got: Vec<f32> = out.chunks_exact(4).map(|b| PcmFormat::F32Le.decode(b) as f32).collect();
        prop_assert_eq!(got, want);
    }
}
