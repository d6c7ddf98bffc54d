//! The normal equations of one channel, accumulated over its samples in blocks.

use super::Channel;
use crate::linalg::least_squares::NormalEquations;
use crate::linalg::{Complex, Mat, dot};
use std::f64::consts::{PI, TAU};

/// Samples that are handled at a time: the columns of a few tones fit the first-level cache.
pub(super) const BLOCK: usize = 512;

/// e^{2 pi j f n} for blocks of consecutive n.
pub(super) struct Oscillator {
    /// f, cycles per sample.
    cycles: f64,
    /// e^{2 pi j f m} for m < BLOCK.
    rotations: Vec<Complex<f64>>,
}

impl Oscillator {
    /// Of `cycles` per sample.
    pub(super) fn new(cycles: f64) -> Self {
        Self { cycles, rotations: (0..BLOCK).map(|m| rotation(cycles, m as f64)).collect() }
    }

    /// cos and sin of 2 pi f (first + m) for the samples of a block.
    pub(super) fn fill(&self, first: f64, cosines: &mut [f64], sines: &mut [f64]) {
        let start = rotation(self.cycles, first);
        for ((cosine, sine), rotation) in cosines.iter_mut().zip(sines).zip(&self.rotations) {
            *cosine = start.re * rotation.re - start.im * rotation.im;
            *sine = start.re * rotation.im + start.im * rotation.re;
        }
    }
}

/// e^{2 pi j cycles n}.
fn rotation(cycles: f64, n: f64) -> Complex<f64> {
    Complex::from_polar(1.0, TAU * fractional_cycles(cycles, n))
}

/// cycles n without whole cycles, in -1/2 ..= 1/2. A plain product would lose digits of the phase in long
/// records, so the rounding error of the product is added again.
pub(super) fn fractional_cycles(cycles: f64, n: f64) -> f64 {
    let product = cycles * n;
    product - product.round() + cycles.mul_add(n, -product)
}

/// The parameters at which a channel is linearised: the coefficients of 1, cosine and sine of each tone,
/// with the time of the phases at the centre of the record.
pub(super) struct Linearisation<'a> {
    pub(super) oscillators: &'a [Oscillator],
    pub(super) linear: &'a [f64],
    /// Samples in the unit of time of the derivatives; `None` for known frequencies.
    pub(super) unit: Option<f64>,
}

/// Number of linear coefficients of `tones` tones: a constant, and a cosine and a sine of each.
pub(super) fn linear_count(tones: usize) -> usize {
    1 + 2 * tones
}

/// The sample index at the centre of a record.
pub(super) fn centre(samples: usize) -> f64 {
    0.5 * (samples as f64 - 1.0)
}

/// One pass over the samples. The columns of J are 1, then cosine and sine of each tone, then the derivative
/// by each frequency; r is what the present parameters leave of the samples.
pub(super) fn accumulate(channel: &Channel<'_>, point: &Linearisation<'_>) -> NormalEquations {
    let columns = point.linear.len() + point.unit.map_or(0, |_| point.oscillators.len());
    let mut normal = NormalEquations::new(columns);
    let is_whole = point.unit.is_none() && channel.used() == channel.samples.len();
    let mut block = JacobianBlock { columns: vec![0.0; columns * BLOCK], residual: vec![0.0; BLOCK] };
    for first in (0..channel.samples.len()).step_by(BLOCK) {
        normal.rows += block.load(channel, point, first);
        for i in 0..columns {
            normal.projection[(i, 0)] += dot(block.column(i), &block.residual);
            for j in (0..=i).filter(|_| !is_whole) {
                normal.gram[(i, j)] += dot(block.column(i), block.column(j));
            }
        }
        normal.squares += dot(&block.residual, &block.residual);
    }
    if is_whole {
        normal.gram = gram_of_whole(point.oscillators, channel.samples.len());
    }
    normal.gram.fill_upper_triangle_with_lower_triangle();
    normal
}

/// The Gram matrix of 1, cosines and sines of a record without gaps. Since time counts from the centre, sums
/// of sines vanish, and with the sum D of cosines
///
/// ```text
/// <1, cos a> = D(a)
/// <cos a, cos b> = (D(a - b) + D(a + b)) / 2   <sin a, sin b> = (D(a - b) - D(a + b)) / 2
/// ```
fn gram_of_whole(oscillators: &[Oscillator], samples: usize) -> Mat {
    let columns = linear_count(oscillators.len());
    let mut gram = Mat::zeros(columns, columns);
    gram[(0, 0)] = samples as f64;
    for (k, one) in oscillators.iter().enumerate() {
        let row = linear_count(k);
        gram[(row, 0)] = sum_of_cosines(one.cycles, samples);
        for (j, other) in oscillators[..=k].iter().enumerate() {
            let column = linear_count(j);
            let minus = sum_of_cosines(one.cycles - other.cycles, samples);
            let plus = sum_of_cosines(one.cycles + other.cycles, samples);
            gram[(row, column)] = 0.5 * (minus + plus);
            gram[(row + 1, column + 1)] = 0.5 * (minus - plus);
        }
    }
    gram
}

/// D = sum of cos(2 pi cycles t) over t = -(N - 1)/2 .. (N - 1)/2 = sin(pi N cycles) / sin(pi cycles).
fn sum_of_cosines(cycles: f64, samples: usize) -> f64 {
    let whole = cycles.round();
    let rest = cycles - whole;
    // A whole cycle per sample inverts the sum if the instants lie between the integers.
    let sign = if whole % 2.0 != 0.0 && samples.is_multiple_of(2) { -1.0 } else { 1.0 };
    if rest == 0.0 {
        return sign * samples as f64;
    }
    let angle = TAU * fractional_cycles(0.5 * rest, samples as f64);
    sign * angle.sin() / (PI * rest).sin()
}

/// The columns of J and r for [`BLOCK`] samples, zero after the end of the record.
struct JacobianBlock {
    columns: Vec<f64>,
    residual: Vec<f64>,
}

impl JacobianBlock {
    fn column(&self, i: usize) -> &[f64] {
        &self.columns[i * BLOCK..(i + 1) * BLOCK]
    }

    /// Fills the block from sample `first` on; returns the number of samples that take part.
    fn load(&mut self, channel: &Channel<'_>, point: &Linearisation<'_>, first: usize) -> usize {
        let count = (channel.samples.len() - first).min(BLOCK);
        let time = first as f64 - centre(channel.samples.len());
        self.fill_columns(point, time);
        self.residual[..count].copy_from_slice(&channel.samples[first..first + count]);
        for (i, coefficient) in point.linear.iter().enumerate() {
            let column = &self.columns[i * BLOCK..(i + 1) * BLOCK];
            self.residual.iter_mut().zip(column).for_each(|(r, x)| *r -= coefficient * x);
        }
        // Rows of samples that take no part are zero.
        let mut used = BLOCK;
        for m in (0..BLOCK).filter(|&m| m >= count || !channel.uses(first + m)) {
            self.columns.iter_mut().skip(m).step_by(BLOCK).for_each(|x| *x = 0.0);
            self.residual[m] = 0.0;
            used -= 1;
        }
        used
    }

    fn fill_columns(&mut self, point: &Linearisation<'_>, time: f64) {
        self.columns[..BLOCK].fill(1.0);
        let (linear, derivatives) = self.columns.split_at_mut(point.linear.len() * BLOCK);
        let mut derivatives = derivatives.chunks_exact_mut(BLOCK);
        for (k, (oscillator, pair)) in
            point.oscillators.iter().zip(linear[BLOCK..].chunks_exact_mut(2 * BLOCK)).enumerate()
        {
            let (cosines, sines) = pair.split_at_mut(BLOCK);
            oscillator.fill(time, cosines, sines);
            let (Some(unit), Some(derivative)) = (point.unit, derivatives.next()) else { continue };
            let (a, b) = (point.linear[linear_count(k)], point.linear[linear_count(k) + 1]);
            for (m, slot) in derivative.iter_mut().enumerate() {
                *slot = (time + m as f64) / unit * (b * cosines[m] - a * sines[m]);
            }
        }
    }
}
