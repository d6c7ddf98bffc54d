//! Overlap-save against the definition of the sum, and against a scalar twin with the same bits.

use super::*;
use crate::tests::support::{
    Noise, by, definition, fir_bank, fuses, norm, precise, random_taps, recursive_bank, run, start, worst,
};
use crate::{Algorithm, Options, Precision};
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
        let at = |frame: isize, i: usize| match usize::try_from(frame) {
            Ok(frame) => input.get(frame * n + i).copied().unwrap_or_default(),
            Err(_) => T::default(),
        };
        let mut out = vec![];
        for first in (0..input.len() / n).step_by(2 * block) {
            let x: Vec<_> = (0..n)
                .map(|i| {
                    let frame = |t: usize| (first + t) as isize - (lags - 1) as isize;
                    let pair = |t| [at(frame(t), i), at(frame(t + block), i)];
                    self.forward(&(0..len).map(pair).collect::<Vec<_>>())
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
    precise(Algorithm::OverlapSave { transform: Some(len) }, precision)
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
            let twin = Twin { fused: fuses(isa) };
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

/// The largest error in units of eps log2 F times the norm of a phase's filters times the norm of the inputs
/// of two blocks.
fn relative_error(taps: &[Vec<f64>], m: usize, len: usize, input: &[f32], eps: f64, got: &[f32]) -> f64 {
    let n = taps.len();
    let filters = (0..m)
        .map(|p| norm(taps.iter().flat_map(|f| f.iter().skip(p).step_by(m).copied())))
        .fold(0.0, f64::max);
    let inputs = input.chunks(n * 2 * len).map(|x| norm(x.iter().map(|&x| f64::from(x)))).fold(0.0, f64::max);
    let scale = eps * f64::from(len.ilog2()) * filters * inputs;
    worst(&definition(taps, m, input), got) / scale
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
fn long_prime_and_empty_filters_work() {
    let mut noise = Noise(44);
    for count in [0, 1, 2, 509, 4001] {
        let taps = random_taps(2, count, &mut noise);
        let input = noise.samples(2 * 3000);
        let bank = fir_bank(taps.clone(), 2);
        let got = run(&bank, by(Algorithm::OverlapSave { transform: None }), &input);
        let error = worst(&definition(&taps, 2, &input), &got);
        assert!(error < 1e-4 * (count as f64 + 1.0).sqrt(), "{count} taps: {error:e}");
    }
}

#[test]
fn input_that_makes_a_transform_overflow_does_not_make_the_output_overflow() {
    let taps = vec![vec![0.25; 40], vec![-0.25; 40]];
    // Alternating signs: each output is small, the spectrum at half the rate is not.
    let input: Vec<f32> = (0..2 * 500).map(|i| if i / 2 % 2 == 0 { 2e38 } else { -2e38 }).collect();
    let got = run(&fir_bank(taps.clone(), 2), options(64, Precision::Single), &input);
    let error = worst(&definition(&taps, 2, &input), &got);
    assert!(error < 1e-5 * 2e38, "{error:e}");
}

#[test]
fn recursive_banks_have_no_transforms() {
    let filter = crate::StateSpace { a: vec![], b: vec![], c: vec![vec![]], d: vec![vec![1.0]] };
    let bank = recursive_bank(filter);
    let refused = |algorithm| start(&bank, by(algorithm)).err();
    assert_eq!(
        refused(Algorithm::OverlapSave { transform: None }),
        Some(BuildError::Recursive { algorithm: "overlap-save" })
    );
    assert_eq!(refused(Algorithm::Auto), None);
}

#[test]
fn spectra_that_would_fill_the_memory_are_refused_or_not_chosen() {
    let taps = vec![vec![1.0; 1024]; 1024];
    let bank = fir_bank(taps, 1024);
    let made = |algorithm| start(&bank, by(algorithm));
    let len = 1 << 20;
    let refused = BuildError::Spectra { channels: 1024, ratio: 1024, len };
    assert_eq!(made(Algorithm::OverlapSave { transform: Some(len) }).err(), Some(refused));
}
