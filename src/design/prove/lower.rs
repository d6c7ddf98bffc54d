//! Searches for witnesses of the lower end: directions and frequencies that bind the taps of all FIR banks
//! of one length, or a finite horizon over which every causal bank has a larger error.
//!
//! For given directions a at some frequencies, consider the taps of least sum of ||a* K||^2. Their error is
//! orthogonal to every change of the taps, and this error gives the witnesses. Double precision finds them
//! for most banks. Long filters have changes of the taps that hardly change the sum, down to 1e-40 of the
//! strongest; double precision loses them, but they lower the sum. They raise the error between the
//! frequencies, so in 512 bits the energy of the error for a faint white input is added to the sum.

use super::witness;
use crate::arithmetic::{Float512, Number, dense};
use crate::bank::{Bank, CausalWitness, DualWitness, LowerProof, SynthesisFilters};
use crate::design::DesignError;
use crate::design::limits::Stop;
use crate::design::merging::Repeats;
use crate::design::methods::{DualPoint, DualSolution};
use crate::design::plant::LiftedPlant;
use crate::design::problem::Problem;
use crate::linalg::{self, CMat, Complex, Mat, power_of_two};
use crate::lti::FrequencyResponse;
use crate::spec::Method;
use crate::verify::enclosed::ComplexParts;
use crate::verify::{EnclosedErrorSystem, Precision, Recursion};
use nalgebra::DMatrix as Matrix;

/// Directions with less than this share of the dual's weight are ignored: they move the bound by less than
/// the accuracy of gamma.
const NEGLIGIBLE_WEIGHT: f64 = 1e-9;
/// Maximum number of witnesses, with up to [`MOST_LONG_TAPS`] taps: an optimum of n taps may bind n + 1
/// directions, and an interior point has more that carry weight.
const MAX_WITNESSES: usize = 256;
/// With more taps, where their number is the time of the search.
const MAX_WITNESSES_OF_MANY: usize = 64;
/// Directions of tap space with less effect than this, relative to the strongest, are lost to rounding.
const RANK: f64 = 1e-13;
/// Relative distance from the upper end within which a bound for FIR banks is not searched further for error
/// systems of more than [`MANY_STATES`]: the finite horizon takes a minute there.
const CLOSE_BOUND: f64 = 1e-3;
const MANY_STATES: usize = 48;
/// Weight of the white input relative to that of all directions, times the size of the reference samples
/// over gamma. The bound loses about this much of itself.
const RIDGES: [f64; 2] = [1e-7, 1e-5];
/// Most taps of all channels: for more, the factorisations take seconds, and no bank of the tests gained by
/// them.
const MOST_LONG_TAPS: usize = 256;
/// Maximum number of slow periods in 106-bit arithmetic.
const SHORT_PERIODS: usize = 512;
/// Maximum number of slow periods in 512-bit arithmetic, where each takes some milliseconds.
const LONG_PERIODS: usize = 128;
/// Relative distances of the first trial gammas below the upper end. Most banks are almost optimal.
const FIRST_SHORTFALLS: [f64; 3] = [1e-6, 1e-5, 1e-4];
/// Relative width of the interval at which the bisection ends.
const WIDTH: f64 = 1e-5;
/// Maximum number of bisections in 106-bit arithmetic.
const SHORT_BISECTIONS: usize = 24;
/// Maximum number of bisections in 512-bit arithmetic.
const LONG_BISECTIONS: usize = 6;

/// A proof of a lower bound within `interval`, of `wanted` if that is known: by the dual solution of an FIR
/// design, or else by a finite horizon over which every causal bank has a larger error.
pub(super) fn lower_proof(
    error: &EnclosedErrorSystem<'_>,
    bank: &Bank,
    dual: &DualSolution,
    wanted: Option<f64>,
    interval: (f64, f64),
    stop: &Stop,
) -> Result<Option<LowerProof>, DesignError> {
    let dual = &dual.points[..];
    let bound = bank.method == Method::Fir && !dual.is_empty();
    let mut witnesses = if bound { binding_witnesses(bank, dual)? } else { Vec::new() };
    let mut reached = error.fir_bound(&witnesses).unwrap_or(0.0);
    let suffices = |reached: f64| wanted.is_none_or(|wanted| reached >= wanted);
    for ridge in RIDGES.into_iter().filter(|_| bound) {
        if suffices(reached) || stop.is_due() {
            break;
        }
        let longer = long_witnesses(error, bank, dual, ridge)?.unwrap_or_default();
        let bound = error.fir_bound(&longer).unwrap_or(0.0);
        if bound > reached {
            (witnesses, reached) = (longer, bound);
        }
    }
    let enough =
        suffices(reached) || (error.states() > MANY_STATES && reached >= interval.1 * (1.0 - CLOSE_BOUND));
    let causal = if reached > interval.0 && enough { None } else { causal_witness(error, interval, stop) };
    Ok(match causal {
        Some(witness) if witness.gamma > reached => Some(LowerProof::Causal(witness)),
        _ => (reached > interval.0).then_some(LowerProof::Fir(witnesses)),
    })
}

/// Witnesses that bound all FIR banks of the bank's length, with the directions and frequencies of the dual
/// solution. Identical channels count once.
fn binding_witnesses(bank: &Bank, dual: &[DualPoint]) -> Result<Vec<DualWitness>, DesignError> {
    let SynthesisFilters::Fir(taps) = &bank.filters else { return Ok(Vec::new()) };
    let merged = Problem::of_bank(bank)?.merge_channels(Repeats::AtOneInstant);
    let units = merged.problem.measurement_units()?;
    let merged = merged.of_unit_size()?;
    let plant = LiftedPlant::new(&merged.problem);
    let parts = &merged.shares;
    let directions = directions(dual, max_witnesses(taps.len() * taps[0].len()))?;
    let mut least = TapLeastSquares::new(&plant, &directions, taps[0].len());
    least.solve()?;
    // The first channel of each group carries the group's weight.
    let group = |i: usize| parts[i].representative;
    let first = |i: usize| (0..i).all(|before| group(before) != group(i));
    let spread = |column: CMat| -> Vec<[f64; 2]> {
        let weight =
            |i: usize| if first(i) { column[group(i)] * units[group(i)] } else { Complex::new(0.0, 0.0) };
        (0..parts.len()).map(weight).map(|z| [-z.re, -z.im]).collect()
    };
    let directions = directions.iter().enumerate();
    Ok(directions
        .map(|(t, (omega, a))| DualWitness { measured: spread(least.estimate(t)), ..witness(*omega, a) })
        .collect())
}

/// The same in 512 bits with a white input of the weight `ridge`; `None` if there are too many taps, or 512
/// bits do not suffice.
fn long_witnesses(
    error: &EnclosedErrorSystem<'_>,
    bank: &Bank,
    dual: &[DualPoint],
    ridge: f64,
) -> Result<Option<Vec<DualWitness>>, DesignError> {
    let SynthesisFilters::Fir(taps) = &bank.filters else { return Ok(None) };
    let directions = directions(dual, max_witnesses(taps.len() * taps[0].len()))?;
    let mut found: Vec<DualWitness> = directions.iter().map(|(omega, a)| witness(*omega, a)).collect();
    let channels = error.distinct_channels();
    let Some(estimates) = Normal::estimates(error, bank, &found, &channels, ridge) else { return Ok(None) };
    for (witness, estimate) in found.iter_mut().zip(estimates) {
        witness.measured = vec![[0.0; 2]; taps.len()];
        for (&channel, value) in channels.iter().zip(estimate) {
            witness.measured[channel] = value.map(|x| -x.nearest() + 0.0);
        }
    }
    Ok(Some(found))
}

/// Maximum number of witnesses for so many taps of all channels.
pub(in crate::design) fn max_witnesses(taps: usize) -> usize {
    if taps <= MOST_LONG_TAPS { MAX_WITNESSES } else { MAX_WITNESSES_OF_MANY }
}

/// The heaviest directions of a dual with their frequencies, at most `most`; the square of their length is
/// their weight.
fn directions(dual: &[DualPoint], most: usize) -> Result<Vec<(f64, CMat)>, DesignError> {
    let mut all = Vec::new();
    for point in dual {
        let svd = linalg::svd(&point.weight)?;
        let scaled = |k: usize| svd.u.columns(k, 1) * Complex::new(svd.s[k].sqrt(), 0.0);
        all.extend((0..svd.s.len()).map(|k| (svd.s[k], point.omega, scaled(k))));
    }
    all.sort_by(|x, y| y.0.total_cmp(&x.0));
    let total: f64 = all.iter().map(|(weight, ..)| weight).sum();
    let heavy = all.into_iter().take(most).take_while(|(weight, ..)| *weight > NEGLIGIBLE_WEIGHT * total);
    Ok(heavy.map(|(_, omega, a)| (omega, a)).collect())
}

/// The least-squares problem of the taps for given directions a and frequencies: min over taps of sum |a*
/// (W - F H)|^2.
struct TapLeastSquares<'a> {
    directions: &'a [(f64, CMat)],
    channels: usize,
    ratio: usize,
    length: usize,
    /// For each direction the lower triangular root of the measured samples' Gram matrix, and a* W in its
    /// coordinates.
    targets: Vec<(CMat, CMat)>,
    taps: Vec<f64>,
}

impl<'a> TapLeastSquares<'a> {
    fn new(plant: &LiftedPlant, directions: &'a [(f64, CMat)], length: usize) -> Self {
        let response = FrequencyResponse::new(plant.system());
        let (n, m) = (plant.channels(), plant.ratio());
        let target = |(omega, a): &(f64, CMat)| {
            let l = linalg::lq_factor(&response.at_frequency(*omega));
            let k = n.min(l.ncols());
            (l.view((0, 0), (n, k)).into_owned(), l.view((n, 0), (m, k)).ad_mul(a))
        };
        let targets = directions.iter().map(target).collect();
        Self { directions, channels: n, ratio: m, length, targets, taps: Vec::new() }
    }

    /// The contribution of a unit tap at time n to F* a, for one direction.
    fn phasor(&self, direction: usize, n: usize) -> Complex<f64> {
        let (omega, a) = &self.directions[direction];
        a[n % self.ratio] * Complex::from_polar(1.0, omega * (n / self.ratio) as f64)
    }

    /// F* a of the taps found.
    fn estimate(&self, direction: usize) -> CMat {
        let sum = |i: usize| {
            (0..self.length).map(|n| self.phasor(direction, n) * self.taps[i * self.length + n]).sum()
        };
        CMat::from_fn(self.channels, 1, |i, _| sum(i))
    }

    /// The taps of the least sum of squares; if they are not unique, those of least norm.
    fn solve(&mut self) -> Result<(), DesignError> {
        let rows: usize = self.targets.iter().map(|(root, _)| 2 * root.ncols()).sum();
        let mut map = Mat::zeros(rows, self.channels * self.length);
        let mut right = Mat::zeros(rows, 1);
        let mut row = 0;
        for (t, (root, target)) in self.targets.iter().enumerate() {
            for k in 0..root.ncols() {
                (right[(row, 0)], right[(row + 1, 0)]) = (target[k].re, target[k].im);
                for n in 0..self.length {
                    let phasor = self.phasor(t, n);
                    for i in 0..self.channels {
                        let z = root[(i, k)].conj() * phasor;
                        (map[(row, i * self.length + n)], map[(row + 1, i * self.length + n)]) = (z.re, z.im);
                    }
                }
                row += 2;
            }
        }
        // Each channel has its own unit, so that weak channels are not lost to rounding.
        let units = self.units(&map);
        map.column_iter_mut().zip(&units).for_each(|(mut column, unit)| column.unscale_mut(*unit));
        let svd = linalg::svd(&map)?;
        let floor = RANK * svd.s.first().copied().unwrap_or(0.0);
        let mut taps = Mat::zeros(map.ncols(), 1);
        // The second pass corrects the rounding errors of the first.
        for _ in 0..2 {
            let mut part = svd.u.tr_mul(&(&right - &map * &taps));
            part.iter_mut().zip(&svd.s).for_each(|(x, &s)| *x = if s > floor { *x / s } else { 0.0 });
            taps += &svd.v * part;
        }
        self.taps = taps.iter().zip(&units).map(|(tap, unit)| tap / unit).collect();
        Ok(())
    }

    /// For each tap the power of two that is near the largest effect of any tap of its channel.
    fn units(&self, map: &Mat) -> Vec<f64> {
        let channel = |i: usize| map.columns(i * self.length, self.length).amax();
        (0..self.channels).flat_map(|i| vec![power_of_two(channel(i)); self.length]).collect()
    }
}

/// The least-squares problem of the taps f_{p,j,i} in normal form.
struct Normal<'a> {
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
    fn estimates(
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
        let index = |d: usize, (p, q): (usize, usize), (i, k): (usize, usize)| {
            ((d * m + p) * m + q) * n * n + i * n + k
        };
        let mut sums = vec![Float512::ZERO; lags * m * m * n * n];
        for t in 0..self.directions.len() {
            let powers = self.powers(t, lags);
            for (p, q) in pairs(m) {
                let both = times(conjugate(self.a(t, p)), self.a(t, q));
                for (i, k) in pairs(n) {
                    let [re, im] = times(both, entry(&self.moments[t][1], m + i, m + k));
                    for (d, power) in powers.iter().enumerate() {
                        let sum = &mut sums[index(d, (p, q), (i, k))];
                        *sum += re * power[0] - im * power[1];
                    }
                }
            }
        }
        let at = |row: usize| (self.times[row / n], row % n);
        Matrix::from_fn(self.times.len() * n, self.times.len() * n, |row, column| {
            let (((j, p), i), ((l, q), k)) = (at(row.max(column)), at(row.min(column)));
            let sum = sums[index(j - l, (p, q), (i, k))];
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

/// The largest gamma found in the interval that no causal bank achieves.
fn causal_witness(
    error: &EnclosedErrorSystem<'_>,
    (lower, upper): (f64, f64),
    stop: &Stop,
) -> Option<CausalWitness> {
    let refuted = |gamma: f64, precision: Precision| {
        if stop.is_due() {
            return None;
        }
        let limit = if precision == Precision::Short { SHORT_PERIODS } else { LONG_PERIODS };
        match error.causal_recursion(gamma, limit, precision) {
            Recursion::Refuted { periods } => Some(CausalWitness { gamma, periods }),
            Recursion::Standing | Recursion::Undecided => None,
        }
    };
    let near = FIRST_SHORTFALLS.map(|shortfall| upper * (1.0 - shortfall));
    let near = near.into_iter().filter(|&gamma| gamma > lower);
    let short = near.clone().find_map(|gamma| refuted(gamma, Precision::Short));
    let reached = short.map_or(lower, |witness| witness.gamma);
    if reached >= upper * (1.0 - FIRST_SHORTFALLS[1]) {
        return short;
    }
    let long = near.filter(|&gamma| gamma > reached).find_map(|gamma| refuted(gamma, Precision::Long));
    let search = |precision, count| bisected((lower, upper), count, |gamma| refuted(gamma, precision));
    long.or(short)
        .or_else(|| search(Precision::Short, SHORT_BISECTIONS))
        .or_else(|| search(Precision::Long, LONG_BISECTIONS))
}

/// `count` bisections between the ends, at the geometric mean because the ends may be far apart.
fn bisected(
    (lower, upper): (f64, f64),
    count: usize,
    refuted: impl Fn(f64) -> Option<CausalWitness>,
) -> Option<CausalWitness> {
    let (mut best, mut below, mut standing) = (None, lower, upper);
    for _ in 0..count {
        if standing - below <= WIDTH * standing {
            break;
        }
        let gamma = if below > 0.0 { (below * standing).sqrt() } else { 0.1 * standing };
        match refuted(gamma) {
            Some(witness) => (best, below) = (Some(witness), gamma),
            None => standing = gamma,
        }
    }
    best
}
