//! The taps of least sum in 512 bits, for directions that double precision does not resolve.
//!
//! Their normal equations hold the squares of the directions, and beside them the energy of the error for a
//! faint white input, see [`super::lower`].

use crate::arithmetic::{Float512, Number, dense};
use crate::bank::{Bank, DualWitness, SynthesisFilters};
use crate::verify::EnclosedErrorSystem;
use crate::verify::enclosed::ComplexParts;
use nalgebra::DMatrix as Matrix;

/// Most taps of all channels: for more, the factorisations take seconds, and no bank of the tests gained by
/// them.
pub(super) const MOST_LONG_TAPS: usize = 256;

/// The least-squares problem of the taps f_{p,j,i} in normal form.
pub(super) struct Normal<'a> {
    directions: &'a [DualWitness],
    /// For each direction z and Gamma.
    moments: Vec<[ComplexParts; 2]>,
    channels: usize,
    ratio: usize,
    /// Weight of the white input.
    ridge: f64,
    /// (lag j, output p) of the taps that there are, in the order of time.
    times: Vec<(usize, usize)>,
}

/// (a + ib)(c + id).
fn times([a, b]: [Float512; 2], [c, d]: [Float512; 2]) -> [Float512; 2] {
    [a * c - b * d, a * d + b * c]
}

fn conjugate([a, b]: [Float512; 2]) -> [Float512; 2] {
    [a, -b]
}

fn entry(m: &ComplexParts, i: usize, j: usize) -> [Float512; 2] {
    [m[0][(i, j)], m[1][(i, j)]]
}

impl<'a> Normal<'a> {
    /// F* a of the taps of least sum for the distinct `channels`, for each direction.
    pub(super) fn estimates(
        error: &EnclosedErrorSystem<'_>,
        bank: &Bank,
        directions: &'a [DualWitness],
        channels: &[usize],
        ridge: f64,
    ) -> Option<Vec<Vec<[Float512; 2]>>> {
        let (ratio, SynthesisFilters::Fir(taps)) = (bank.ratio, &bank.filters) else { return None };
        let length = taps[0].len();
        if channels.len() * length > MOST_LONG_TAPS {
            return None;
        }
        let [covariance, cross] = error.precise_covariance(channels, length.div_ceil(ratio))?;
        let moments = directions.iter().map(|of| error.precise_gram(of.half, channels)).collect();
        let times = (0..length).map(|n| (n / ratio, n % ratio)).collect();
        let weight: f64 = directions.iter().flat_map(|d| &d.reference).flatten().map(|x| x * x).sum();
        let ridge = ridge * weight * bank.gamma.norm.unwrap_or(0.0) / error.scale();
        let normal = Self { directions, moments, channels: channels.len(), ratio, ridge, times };
        let taps = normal.solve(&covariance, &cross)?;
        Some((0..directions.len()).map(|t| normal.estimate(t, &taps)).collect())
    }

    fn a(&self, t: usize, p: usize) -> [Float512; 2] {
        self.directions[t].reference[p].map(Float512::from)
    }

    /// z^0 .. z^-(count - 1).
    fn powers(&self, t: usize, count: usize) -> Vec<[Float512; 2]> {
        let back = conjugate(entry(&self.moments[t][0], 0, 0));
        let one = [Float512::from(1.0), Float512::ZERO];
        std::iter::successors(Some(one), |&power| Some(times(power, back))).take(count).collect()
    }

    /// The taps, in the order of time and, at one time, of the channels.
    fn solve(&self, covariance: &Matrix<Float512>, cross: &Matrix<Float512>) -> Option<Vec<Float512>> {
        let factor = dense::cholesky(&self.matrix(covariance))?;
        let right = Matrix::from_vec(factor.nrows(), 1, self.right(cross));
        let taps = dense::solve_factored(&factor, &right);
        Some(taps.iter().copied().collect())
    }

    /// sum over directions of Re conj(a_p) a_p' z^-(j - j') Gamma_{i,i'}, and the white input.
    fn matrix(&self, covariance: &Matrix<Float512>) -> Matrix<Float512> {
        let (n, m) = (self.channels, self.ratio);
        let lags = covariance.nrows() / n;
        // By lag difference d >= 0, the outputs p, p' and the channels i, i'.
        let index = |d: usize, outputs: [usize; 2], channels: [usize; 2]| {
            ((d * m + outputs[0]) * m + outputs[1]) * n * n + channels[0] * n + channels[1]
        };
        let mut sums = vec![Float512::ZERO; lags * m * m * n * n];
        for t in 0..self.directions.len() {
            let powers = self.powers(t, lags);
            for (p, q) in pairs(m) {
                let both = times(conjugate(self.a(t, p)), self.a(t, q));
                for (i, k) in pairs(n) {
                    let [re, im] = times(both, entry(&self.moments[t][1], m + i, m + k));
                    for (d, power) in powers.iter().enumerate() {
                        let sum = &mut sums[index(d, [p, q], [i, k])];
                        *sum += re * power[0] - im * power[1];
                    }
                }
            }
        }
        let at = |row: usize| (self.times[row / n], row % n);
        Matrix::from_fn(self.times.len() * n, self.times.len() * n, |row, column| {
            let (((j, p), i), ((l, q), k)) = (at(row.max(column)), at(row.min(column)));
            let sum = sums[index(j - l, [p, q], [i, k])];
            if p == q { sum + Float512::from(self.ridge) * covariance[(j * n + i, l * n + k)] } else { sum }
        })
    }

    /// sum over directions of Re conj(a_p) z^-j (Gamma_hw a)_i, and the white input.
    fn right(&self, cross: &Matrix<Float512>) -> Vec<Float512> {
        let (n, m) = (self.channels, self.ratio);
        let lags = self.times.last().map_or(0, |(lag, _)| lag + 1);
        let white = |row: usize| {
            let (lag, p) = self.times[row / n];
            Float512::from(self.ridge) * cross[(p, lag * n + row % n)]
        };
        let mut sums: Vec<Float512> = (0..self.times.len() * n).map(white).collect();
        for t in 0..self.directions.len() {
            let powers = self.powers(t, lags);
            for i in 0..n {
                let from = |p: usize| times(entry(&self.moments[t][1], m + i, p), self.a(t, p));
                let target = (0..m).map(from).fold([Float512::ZERO; 2], |[a, b], [c, d]| [a + c, b + d]);
                for (row, &(lag, p)) in self.times.iter().enumerate() {
                    let rotated = times(times(conjugate(self.a(t, p)), powers[lag]), target);
                    sums[row * n + i] += rotated[0];
                }
            }
        }
        sums
    }

    /// F* a for direction t: sum over taps of f a_p z^j.
    fn estimate(&self, t: usize, taps: &[Float512]) -> Vec<[Float512; 2]> {
        let powers = self.powers(t, self.times.last().map_or(0, |(lag, _)| lag + 1));
        let mut sums = vec![[Float512::ZERO; 2]; self.channels];
        for (row, &(lag, p)) in self.times.iter().enumerate() {
            let phasor = times(self.a(t, p), conjugate(powers[lag]));
            for (i, sum) in sums.iter_mut().enumerate() {
                let tap = taps[row * self.channels + i];
                *sum = [sum[0] + tap * phasor[0], sum[1] + tap * phasor[1]];
            }
        }
        sums
    }
}

fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |a| (0..count).map(move |b| (a, b)))
}
