//! Sampled sines in blocks.

use crate::linalg::Complex;
use std::f64::consts::TAU;

/// Samples that are handled at a time: the columns of a few tones fit the first-level cache.
pub(super) const BLOCK: usize = 512;

/// e^{2 pi j f n} for blocks of consecutive n.
pub(super) struct Oscillator {
    cycles: f64,
    /// e^{2 pi j f m} for m < BLOCK.
    turns: Vec<Complex<f64>>,
}

impl Oscillator {
    /// Of `cycles` per sample.
    pub(super) fn new(cycles: f64) -> Self {
        let turns = (0..BLOCK).map(|m| turn(cycles, m as f64)).collect();
        Self { cycles, turns }
    }

    /// Cycles per sample.
    pub(super) fn cycles(&self) -> f64 {
        self.cycles
    }

    /// cos and sin of 2 pi f (first + m) for the samples of a block.
    pub(super) fn fill(&self, first: f64, cosines: &mut [f64], sines: &mut [f64]) {
        let start = turn(self.cycles, first);
        for ((cosine, sine), turn) in cosines.iter_mut().zip(sines).zip(&self.turns) {
            *cosine = start.re * turn.re - start.im * turn.im;
            *sine = start.re * turn.im + start.im * turn.re;
        }
    }
}

/// e^{2 pi j cycles n}. A plain product would lose digits of the phase in long records, so whole turns are
/// removed and the rounding error of the product is added again.
pub(super) fn turn(cycles: f64, n: f64) -> Complex<f64> {
    Complex::from_polar(1.0, TAU * fraction_of_turn(cycles, n))
}

/// cycles n without whole turns, in -1/2 ..= 1/2.
pub(super) fn fraction_of_turn(cycles: f64, n: f64) -> f64 {
    let product = cycles * n;
    product - product.round() + cycles.mul_add(n, -product)
}

/// The inner product of two blocks. Eight partial sums let the compiler use vector instructions.
pub(super) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (xs, ys) = (x.chunks_exact(8), y.chunks_exact(8));
    let rest: f64 = xs.remainder().iter().zip(ys.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in xs.zip(ys) {
        sums.iter_mut().zip(x.iter().zip(y)).for_each(|(sum, (x, y))| *sum += x * y);
    }
    sums.iter().sum::<f64>() + rest
}
