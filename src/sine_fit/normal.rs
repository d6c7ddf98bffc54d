//! The normal equations of one channel, accumulated over its samples.

use super::Channel;
use super::columns::{BLOCK, Oscillator, dot, fraction_of_turn};
use crate::linalg::Mat;
use std::f64::consts::{PI, TAU};

/// J'J, J'r and r'r of a channel. The columns of J are 1, then cosine and sine of each tone, then the
/// derivative by each frequency; r is what the present parameters leave of the samples.
pub(super) struct Normal {
    pub(super) gram: Mat,
    pub(super) projection: Mat,
    /// r'r.
    pub(super) squares: f64,
    /// Samples that took part.
    pub(super) used: usize,
}

/// The parameters at which a channel is linearised: the coefficients of 1, cosine and sine of each tone,
/// with the time of the phases at the centre of the record.
pub(super) struct Point<'a> {
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

impl Normal {
    /// One pass over the samples.
    pub(super) fn accumulate(channel: &Channel<'_>, point: &Point<'_>) -> Self {
        let columns = point.linear.len() + point.unit.map_or(0, |_| point.oscillators.len());
        let (gram, projection) = (Mat::zeros(columns, columns), Mat::zeros(columns, 1));
        let mut normal = Self { gram, projection, squares: 0.0, used: 0 };
        let is_whole = point.unit.is_none() && channel.used() == channel.samples.len();
        let mut block = Block { columns: vec![0.0; columns * BLOCK], residual: vec![0.0; BLOCK] };
        for first in (0..channel.samples.len()).step_by(BLOCK) {
            normal.used += block.load(channel, point, first);
            normal.project(&block);
            if !is_whole {
                normal.add_gram(&block);
            }
        }
        if is_whole {
            normal.gram = gram_of_whole(point.oscillators, channel.samples.len());
        }
        normal.gram.fill_upper_triangle_with_lower_triangle();
        normal
    }

    fn project(&mut self, block: &Block) {
        for i in 0..self.gram.nrows() {
            self.projection[(i, 0)] += dot(block.column(i), &block.residual);
        }
        self.squares += dot(&block.residual, &block.residual);
    }

    fn add_gram(&mut self, block: &Block) {
        for i in 0..self.gram.nrows() {
            for j in 0..=i {
                self.gram[(i, j)] += dot(block.column(i), block.column(j));
            }
        }
    }
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
        gram[(row, 0)] = sum_of_cosines(one.cycles(), samples);
        for (j, other) in oscillators[..=k].iter().enumerate() {
            let column = linear_count(j);
            let minus = sum_of_cosines(one.cycles() - other.cycles(), samples);
            let plus = sum_of_cosines(one.cycles() + other.cycles(), samples);
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
    // A whole cycle per sample turns the sign if the instants lie between the integers.
    let sign = if whole % 2.0 != 0.0 && samples.is_multiple_of(2) { -1.0 } else { 1.0 };
    if rest == 0.0 {
        return sign * samples as f64;
    }
    let turn = TAU * fraction_of_turn(0.5 * rest, samples as f64);
    sign * turn.sin() / (PI * rest).sin()
}

/// The columns of J and r for [`BLOCK`] samples, zero after the end of the record.
struct Block {
    columns: Vec<f64>,
    residual: Vec<f64>,
}

impl Block {
    fn column(&self, i: usize) -> &[f64] {
        &self.columns[i * BLOCK..(i + 1) * BLOCK]
    }

    /// Fills the block from sample `first` on; returns the number of samples that take part.
    fn load(&mut self, channel: &Channel<'_>, point: &Point<'_>, first: usize) -> usize {
        let count = (channel.samples.len() - first).min(BLOCK);
        let time = first as f64 - centre(channel.samples.len());
        self.fill_columns(point, time);
        self.residual[..count].copy_from_slice(&channel.samples[first..first + count]);
        for (i, coefficient) in point.linear.iter().enumerate() {
            let column = &self.columns[i * BLOCK..(i + 1) * BLOCK];
            self.residual.iter_mut().zip(column).for_each(|(r, x)| *r -= coefficient * x);
        }
        self.leave_out(|m| m >= count || !channel.uses(first + m))
    }

    fn fill_columns(&mut self, point: &Point<'_>, time: f64) {
        self.columns[..BLOCK].fill(1.0);
        for (k, oscillator) in point.oscillators.iter().enumerate() {
            let pair = &mut self.columns[linear_count(k) * BLOCK..linear_count(k + 1) * BLOCK];
            let (cosines, sines) = pair.split_at_mut(BLOCK);
            oscillator.fill(time, cosines, sines);
        }
        let Some(unit) = point.unit else { return };
        let (linear, derivatives) = self.columns.split_at_mut(point.linear.len() * BLOCK);
        for (k, derivative) in derivatives.chunks_exact_mut(BLOCK).enumerate() {
            let (cosines, sines) =
                linear[linear_count(k) * BLOCK..linear_count(k + 1) * BLOCK].split_at(BLOCK);
            let (a, b) = (point.linear[linear_count(k)], point.linear[linear_count(k) + 1]);
            for (m, slot) in derivative.iter_mut().enumerate() {
                *slot = (time + m as f64) / unit * (b * cosines[m] - a * sines[m]);
            }
        }
    }

    /// Zeroes the rows of samples that take no part; returns the number of the others.
    fn leave_out(&mut self, is_left_out: impl Fn(usize) -> bool) -> usize {
        let mut used = BLOCK;
        for m in (0..BLOCK).filter(|&m| is_left_out(m)) {
            self.columns.iter_mut().skip(m).step_by(BLOCK).for_each(|x| *x = 0.0);
            self.residual[m] = 0.0;
            used -= 1;
        }
        used
    }
}
