//! Searches for witnesses of the lower end: directions and frequencies that bind the taps of all FIR banks
//! of one length, or a finite horizon over which every causal bank has a larger error.
//!
//! For given directions a at some frequencies, consider the taps of least sum of ||a* K||^2. Their error is
//! orthogonal to every change of the taps, and this error gives the witnesses. Double precision finds them
//! for most banks. Long filters have changes of the taps that hardly change the sum, down to 1e-40 of the
//! strongest; double precision loses them, but they lower the sum. They raise the error between the
//! frequencies, so in 512 bits the energy of the error for a faint white input is added to the sum.

use super::normal_equations::{MOST_LONG_TAPS, Normal};
use super::witness;
use crate::arithmetic::Number;
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
use crate::verify::{EnclosedErrorSystem, Precision, Recursion};
use std::ops::Range;

/// Directions with less than this share of the dual's weight are ignored: they move the bound by less than
/// the accuracy of gamma.
const NEGLIGIBLE_WEIGHT: f64 = 1e-9;
/// Maximum number of witnesses, with up to [`MOST_LONG_TAPS`] taps: an optimum of n taps may bind n + 1
/// directions, and an interior point has more that carry weight.
const MAX_WITNESSES: usize = 256;
/// With more taps, where their number is the time of the search.
const MAX_WITNESSES_OF_MANY: usize = 64;
/// Directions of tap space with less effect than this, relative to the strongest, are lost to rounding.
const RANK_TOLERANCE: f64 = 1e-13;
/// Relative distance from the upper end within which a bound for FIR banks is not searched further for error
/// systems of more than [`MANY_STATES`]: the finite horizon takes a minute there.
const CLOSE_BOUND: f64 = 1e-3;
const MANY_STATES: usize = 48;
/// Weight of the white input relative to that of all directions, times the size of the reference samples
/// over gamma. The bound loses about this much of itself.
const RIDGES: [f64; 2] = [1e-7, 1e-5];
/// Maximum number of slow periods in 106-bit arithmetic.
const SHORT_PERIODS: usize = 512;
/// Maximum number of slow periods in 512-bit arithmetic, where each takes some milliseconds.
const LONG_PERIODS: usize = 128;
/// Relative distances of the first trial gammas below the upper end. Most banks are almost optimal.
const FIRST_SHORTFALLS: [f64; 3] = [1e-6, 1e-5, 1e-4];
/// Relative width of the interval at which the bisection ends.
const BISECTION_WIDTH: f64 = 1e-5;
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
    interval: &Range<f64>,
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
        suffices(reached) || (error.states() > MANY_STATES && reached >= interval.end * (1.0 - CLOSE_BOUND));
    let causal =
        if reached > interval.start && enough { None } else { causal_witness(error, interval, stop) };
    Ok(match causal {
        Some(witness) if witness.gamma > reached => Some(LowerProof::Causal(witness)),
        _ => (reached > interval.start).then_some(LowerProof::Fir(witnesses)),
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
fn max_witnesses(taps: usize) -> usize {
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
        let floor = RANK_TOLERANCE * svd.s.first().copied().unwrap_or(0.0);
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

/// The largest gamma found in the interval that no causal bank achieves.
fn causal_witness(
    error: &EnclosedErrorSystem<'_>,
    interval: &Range<f64>,
    stop: &Stop,
) -> Option<CausalWitness> {
    let Range { start: lower, end: upper } = *interval;
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
    let search = |precision, count| bisected(interval, count, |gamma| refuted(gamma, precision));
    long.or(short)
        .or_else(|| search(Precision::Short, SHORT_BISECTIONS))
        .or_else(|| search(Precision::Long, LONG_BISECTIONS))
}

/// The first gamma that is tried above nothing, over the one that stands: most bounds are within a decade.
const FIRST_BISECTION: f64 = 0.1;

/// `count` bisections between the ends, at the geometric mean because the ends may be far apart.
fn bisected(
    interval: &Range<f64>,
    count: usize,
    refuted: impl Fn(f64) -> Option<CausalWitness>,
) -> Option<CausalWitness> {
    let (mut best, mut below, mut standing) = (None, interval.start, interval.end);
    for _ in 0..count {
        if standing - below <= BISECTION_WIDTH * standing {
            break;
        }
        let gamma = if below > 0.0 { (below * standing).sqrt() } else { FIRST_BISECTION * standing };
        match refuted(gamma) {
            Some(witness) => (best, below) = (Some(witness), gamma),
            None => standing = gamma,
        }
    }
    best
}
