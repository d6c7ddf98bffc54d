//! Witnesses that bind the taps of long filters, found in 512 bits.
//!
//! For directions a at some frequencies, the taps of least sum of ||a* K||^2 leave an error that no change
//! of the taps correlates with; it gives the witnesses. Long filters have changes of the taps that hardly
//! change this sum, down to 1e-40 of the strongest. Double precision loses them, but they lower the sum.
//! They raise the error between the frequencies, so the energy of the error for a faint white input is added
//! to the sum.

use crate::arithmetic::{BigFloat, Matrix, Number};
use crate::bank::DualWitness;
use crate::verify::EnclosedErrorSystem;
use crate::verify::precise::ComplexParts;

/// Weight of the white input relative to that of all directions, times the size of the reference samples
/// over gamma. The bound loses about this much of itself.
pub(super) const RIDGES: [f64; 2] = [1e-7, 1e-5];
/// Most taps of all channels: for more, the factorisations take seconds, and no bank of the tests gained by
/// them.
pub(in crate::design) const MOST_LONG_TAPS: usize = 256;

/// A direction a of the reference samples at a frequency: weight included.
pub(super) struct Direction {
    /// Names the point of the unit circle.
    pub(super) half: [f64; 2],
    /// a.
    pub(super) reference: Vec<[f64; 2]>,
}

/// The least-squares problem of the taps f_{p,j,i} in normal form.
struct Normal<'a> {
    directions: &'a [Direction],
    /// For each direction z and Gamma.
    moments: Vec<[ComplexParts; 2]>,
    channels: usize,
    ratio: usize,
    /// Weight of the white input.
    ridge: f64,
    /// (lag j, output p) of the taps that there are, in the order of time.
    times: Vec<(usize, usize)>,
}

/// The witnesses of `directions` for the taps of the distinct `channels`, of `length` each; `all` channels
/// are in the bank, whose gamma is about `gamma`. `None` if there are too many taps, or 512 bits do not
/// suffice.
pub(super) fn witnesses(
    error: &EnclosedErrorSystem<'_>,
    directions: &[Direction],
    (channels, all): (&[usize], usize),
    (length, ratio): (usize, usize),
    (gamma, ridge): (f64, f64),
) -> Option<Vec<DualWitness>> {
    if channels.len() * length > MOST_LONG_TAPS {
        return None;
    }
    let [covariance, cross] = error.precise_covariance(channels, length.div_ceil(ratio))?;
    let moments = directions.iter().map(|direction| error.precise_gram(direction.half, channels)).collect();
    let times = (0..length).map(|n| (n / ratio, n % ratio)).collect();
    let weight: f64 = directions.iter().flat_map(|d| &d.reference).flatten().map(|x| x * x).sum();
    let ridge = ridge * weight * gamma / error.scale();
    let normal = Normal { directions, moments, channels: channels.len(), ratio, ridge, times };
    let taps = normal.solve(&covariance, &cross)?;
    let witness = |t: usize| {
        let mut measured = vec![[0.0; 2]; all];
        for (&channel, value) in channels.iter().zip(normal.estimate(t, &taps)) {
            measured[channel] = value.map(|x| -x.nearest() + 0.0);
        }
        let Direction { half, reference } = &directions[t];
        DualWitness { half: *half, reference: reference.clone(), measured }
    };
    Some((0..directions.len()).map(witness).collect())
}

/// (a + ib)(c + id).
fn times([a, b]: [BigFloat; 2], [c, d]: [BigFloat; 2]) -> [BigFloat; 2] {
    [a * c - b * d, a * d + b * c]
}

fn conjugate([a, b]: [BigFloat; 2]) -> [BigFloat; 2] {
    [a, -b]
}

fn entry(m: &ComplexParts, i: usize, j: usize) -> [BigFloat; 2] {
    [m[0][(i, j)], m[1][(i, j)]]
}

impl Normal<'_> {
    fn a(&self, t: usize, p: usize) -> [BigFloat; 2] {
        self.directions[t].reference[p].map(BigFloat::from)
    }

    /// z^0 .. z^-(count - 1).
    fn powers(&self, t: usize, count: usize) -> Vec<[BigFloat; 2]> {
        let back = conjugate(entry(&self.moments[t][0], 0, 0));
        let one = [BigFloat::from(1.0), BigFloat::ZERO];
        std::iter::successors(Some(one), |&power| Some(times(power, back))).take(count).collect()
    }

    /// The taps, in the order of time and, at one time, of the channels.
    fn solve(&self, covariance: &Matrix<BigFloat>, cross: &Matrix<BigFloat>) -> Option<Vec<BigFloat>> {
        let factor = self.matrix(covariance).cholesky()?;
        let n = factor.nrows();
        let mut taps = self.right(cross);
        for i in 0..n {
            let rest = (0..i).fold(taps[i], |sum, k| sum - factor[(i, k)] * taps[k]);
            taps[i] = rest / factor[(i, i)];
        }
        for i in (0..n).rev() {
            let rest = (i + 1..n).fold(taps[i], |sum, k| sum - factor[(k, i)] * taps[k]);
            taps[i] = rest / factor[(i, i)];
        }
        Some(taps)
    }

    /// sum over directions of Re conj(a_p) a_p' z^-(j - j') Gamma_{i,i'}, and the white input.
    fn matrix(&self, covariance: &Matrix<BigFloat>) -> Matrix<BigFloat> {
        let (n, m) = (self.channels, self.ratio);
        let lags = covariance.nrows() / n;
        // By lag difference d >= 0, the outputs p, p' and the channels i, i'.
        let index = |d: usize, (p, q): (usize, usize), (i, k): (usize, usize)| {
            ((d * m + p) * m + q) * n * n + i * n + k
        };
        let mut sums = vec![BigFloat::ZERO; lags * m * m * n * n];
        for t in 0..self.directions.len() {
            let powers = self.powers(t, lags);
            for (p, q) in pairs(m) {
                let both = times(conjugate(self.a(t, p)), self.a(t, q));
                for (i, k) in pairs(n) {
                    let [re, im] = times(both, entry(&self.moments[t][1], m + i, m + k));
                    for (d, power) in powers.iter().enumerate() {
                        let sum = &mut sums[index(d, (p, q), (i, k))];
                        *sum = *sum + (re * power[0] - im * power[1]);
                    }
                }
            }
        }
        let at = |row: usize| (self.times[row / n], row % n);
        Matrix::from_fn(self.times.len() * n, self.times.len() * n, |row, column| {
            let (((j, p), i), ((l, q), k)) = (at(row.max(column)), at(row.min(column)));
            let sum = sums[index(j - l, (p, q), (i, k))];
            if p == q { sum + BigFloat::from(self.ridge) * covariance[(j * n + i, l * n + k)] } else { sum }
        })
    }

    /// sum over directions of Re conj(a_p) z^-j (Gamma_hw a)_i, and the white input.
    fn right(&self, cross: &Matrix<BigFloat>) -> Vec<BigFloat> {
        let (n, m) = (self.channels, self.ratio);
        let lags = self.times.last().map_or(0, |(lag, _)| lag + 1);
        let white = |row: usize| {
            let (lag, p) = self.times[row / n];
            BigFloat::from(self.ridge) * cross[(p, lag * n + row % n)]
        };
        let mut sums: Vec<BigFloat> = (0..self.times.len() * n).map(white).collect();
        for t in 0..self.directions.len() {
            let powers = self.powers(t, lags);
            for i in 0..n {
                let from = |p: usize| times(entry(&self.moments[t][1], m + i, p), self.a(t, p));
                let target = (0..m).map(from).fold([BigFloat::ZERO; 2], |[a, b], [c, d]| [a + c, b + d]);
                for (row, &(lag, p)) in self.times.iter().enumerate() {
                    let turned = times(times(conjugate(self.a(t, p)), powers[lag]), target);
                    sums[row * n + i] = sums[row * n + i] + turned[0];
                }
            }
        }
        sums
    }

    /// F* a for direction t: sum over taps of f a_p z^j.
    fn estimate(&self, t: usize, taps: &[BigFloat]) -> Vec<[BigFloat; 2]> {
        let powers = self.powers(t, self.times.last().map_or(0, |(lag, _)| lag + 1));
        let mut sums = vec![[BigFloat::ZERO; 2]; self.channels];
        for (row, &(lag, p)) in self.times.iter().enumerate() {
            let turn = times(self.a(t, p), conjugate(powers[lag]));
            for (i, sum) in sums.iter_mut().enumerate() {
                let tap = taps[row * self.channels + i];
                *sum = [sum[0] + tap * turn[0], sum[1] + tap * turn[1]];
            }
        }
        sums
    }
}

fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |a| (0..count).map(move |b| (a, b)))
}
