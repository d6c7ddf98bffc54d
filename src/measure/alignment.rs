//! Lag, gain and offset between a record and a reference.

use super::MeasureError;
use crate::linalg::least_squares::{LeastSquares, Minimum, NoMinimum, NormalEquations, StepLimits, minimise};
use crate::linalg::{Mat, dot, fourier};
use crate::sine_fit::Channel;
use std::f64::consts::PI;
use std::ops::Range;

/// The lag has settled when it moves by less than this (samples): the rounding of the interpolation.
const SETTLED_LAG_STEP: f64 = 1e-11;
/// A step of the lag is at most half a sample: beyond it the derivative at the start says nothing.
const LARGEST_STEP: f64 = 0.5;
/// The lag is lost when it is so many whole samples from its start.
const FARTHEST: i64 = 2;
/// Fewest samples at which record and reference are compared.
const LEAST_OVERLAP: usize = 16;

/// Samples of each recording from which the whole part of the lag is found.
const SEARCHED: usize = 1 << 20;
/// Least part of the shorter recording that overlaps at a lag.
const LEAST_PART: usize = 2;
/// Lags whose correlation is this close to the largest are tried: the correlation at whole samples is below
/// that at the lag itself.
const LIKELY_PEAK_SHARE: f64 = 0.8;
/// Coefficients that differ by less than this share are one: the noise of the recordings makes such
/// differences between periods of a signal.
const ALIKE_COEFFICIENT_SHARE: f64 = 1e-3;
/// Lags that are tried: so many of the largest correlation, and of those that exceed all nearer to 0.
const MOST_LAGS: usize = 8;

/// Samples on each side of an instant from which it is interpolated.
const INTERPOLATION_REACH: usize = 128;
/// Shape of the Kaiser window: -118 dB outside a transition that begins at 0.485 fs.
const KAISER_BETA: f64 = 12.265;
/// Step of the derivative by the lag, in samples: the square of it, the error, is the square root of the
/// rounding error.
const DERIVATIVE_STEP: f64 = 1e-4;

/// The present lag, gain and offset.
pub(super) struct Alignment<'a> {
    pub(super) samples: &'a [f64],
    pub(super) reference: &'a [f64],
    /// The lag is whole + phase.
    pub(super) whole: i64,
    pub(super) phase: f64,
    pub(super) gain: f64,
    pub(super) offset: f64,
    /// Where the iteration began.
    start: i64,
    /// Samples that are compared at most, and where in the record.
    most: usize,
    within: Range<usize>,
}

/// What the last step found.
pub(super) struct Settled {
    /// Of gain, offset and lag.
    pub(super) covariance: Mat,
    /// Mean square of the error over that of the scaled reference.
    pub(super) error: f64,
}

/// A sample at which record and reference are known.
pub(super) struct AlignedSample {
    /// Index in the record.
    pub(super) n: usize,
    /// r(n - lag).
    pub(super) value: f64,
    /// Its derivative by the lag.
    slope: f64,
    /// y - gain r - offset.
    pub(super) error: f64,
}

impl LeastSquares for Alignment<'_> {
    type Error = MeasureError;
    const MOST_STEPS: usize = 30;

    fn equations(&mut self) -> Result<NormalEquations, MeasureError> {
        self.equations_of(3)
    }

    fn advance(&mut self, step: &[f64]) -> bool {
        self.gain += step[0];
        self.offset += step[1];
        let phase = self.phase + step[2];
        self.whole += phase.round() as i64;
        self.phase = phase - phase.round();
        (self.whole - self.start).abs() <= FARTHEST
    }

    /// Gain and offset follow from the lag.
    fn limits(&self, k: usize, _: f64) -> StepLimits {
        match k {
            2 => StepLimits { largest: LARGEST_STEP, negligible: SETTLED_LAG_STEP },
            _ => StepLimits { largest: f64::INFINITY, negligible: f64::INFINITY },
        }
    }

    fn error(&self, _: NoMinimum) -> MeasureError {
        MeasureError::NoLag { lag: self.start }
    }
}

impl<'a> Alignment<'a> {
    pub(super) fn new(samples: &'a [f64], reference: &'a [f64], whole: i64, most: usize) -> Self {
        let within = 0..samples.len();
        Self { samples, reference, whole, phase: 0.0, gain: 1.0, offset: 0.0, start: whole, most, within }
    }

    /// From now on only these samples of the record are compared.
    pub(super) fn restrict(&mut self, within: Range<usize>) {
        self.within = within;
    }

    /// The samples of the record that have a reference.
    pub(super) fn known(&self) -> Range<usize> {
        let (reach, within) = (INTERPOLATION_REACH as i64, &self.within);
        let first = (self.whole + reach).max(within.start as i64);
        let last = (self.reference.len() as i64 - reach + self.whole).min(within.end as i64);
        usize::try_from(first).unwrap_or(0)..usize::try_from(last.max(first)).unwrap_or(0)
    }

    /// Those among them that are compared.
    pub(super) fn probed(&self) -> Range<usize> {
        let Range { start, end } = self.known();
        start..end.min(start.saturating_add(self.most))
    }

    /// The least squares of the error in lag, gain and offset.
    pub(super) fn settle(&mut self) -> Result<Settled, MeasureError> {
        self.start = self.whole;
        // With a wrong gain the derivative by the lag is wrong, so gain and offset come first.
        let change = self.equations_of(2)?.solve().map_err(|why| self.error(why))?;
        self.gain += change[0];
        self.offset += change[1];
        let Minimum { equations, inverse, .. } = minimise(self)?;
        let signal = self.gain * self.gain * equations.gram[(0, 0)];
        Ok(Settled { covariance: inverse * equations.variance(), error: equations.squares / signal })
    }

    /// The samples at which both are known.
    pub(super) fn points(&self) -> impl Iterator<Item = AlignedSample> {
        let weights = kernel(self.phase);
        let (before, after) = (kernel(self.phase - DERIVATIVE_STEP), kernel(self.phase + DERIVATIVE_STEP));
        let slopes: Vec<f64> =
            before.iter().zip(&after).map(|(a, b)| (b - a) / (2.0 * DERIVATIVE_STEP)).collect();
        let reach = INTERPOLATION_REACH as i64;
        let point = move |n: usize| {
            let begin = (n as i64 - self.whole - reach) as usize;
            let near = &self.reference[begin..=begin + 2 * INTERPOLATION_REACH];
            let (value, slope) = (dot(near, &weights), dot(near, &slopes));
            AlignedSample { n, value, slope, error: self.samples[n] - self.gain * value - self.offset }
        };
        self.probed().map(point).filter(|point| point.error.is_finite())
    }

    /// Of the first so many among gain, offset and lag.
    fn equations_of(&self, parameters: usize) -> Result<NormalEquations, MeasureError> {
        let mut equations = NormalEquations::new(parameters);
        for point in self.points() {
            let row = [point.value, 1.0, self.gain * point.slope];
            equations.add(&row[..parameters], point.error);
        }
        let overlap = equations.rows;
        if overlap >= LEAST_OVERLAP {
            return Ok(equations);
        }
        let (samples, reference) = (self.samples.len(), self.reference.len());
        let needed = LEAST_OVERLAP + 2 * INTERPOLATION_REACH;
        Err(MeasureError::Overlap { samples, reference, overlap, lag: self.whole, needed })
    }
}

/// Coefficients c_j, |j| <= [`INTERPOLATION_REACH`], of x(n - phase) = sum over j of x[n - j] c_j for
/// -1 < phase < 1, stored for increasing sample index: sinc(t) kaiser(t) at t = j - phase, scaled to keep
/// constants. A phase of 0 gives the samples themselves.
fn kernel(phase: f64) -> Vec<f64> {
    let reach = INTERPOLATION_REACH as f64;
    let at = |i: usize| {
        let t = reach - i as f64 - phase;
        let share = 1.0 - (t / (reach + 1.0)).powi(2);
        if share <= 0.0 { 0.0 } else { sinc(t) * bessel_i0(KAISER_BETA * share.sqrt()) }
    };
    let values: Vec<f64> = (0..=2 * INTERPOLATION_REACH).map(at).collect();
    let sum: f64 = values.iter().sum();
    values.iter().map(|x| x / sum).collect()
}

fn sinc(t: f64) -> f64 {
    // Exact zeros at the other samples, where sin(pi t) rounds to something.
    if t == 0.0 {
        1.0
    } else if t.fract() == 0.0 {
        0.0
    } else {
        (PI * t).sin() / (PI * t)
    }
}

/// The modified Bessel function I_0 by its power series; KAISER_BETA is small.
fn bessel_i0(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..=60 {
        term *= quarter / (k * k) as f64;
        sum += term;
    }
    sum
}

/// The lags of the largest correlation coefficients in absolute value, in whole samples, and those with a
/// larger coefficient than all that are nearer to 0: among the many lags that agree for a periodic signal
/// they hold the shortest.
pub(super) fn likely_lags(samples: &[f64], reference: &[f64]) -> Vec<i64> {
    let all = coefficients(samples, reference);
    let largest = all.iter().fold(0.0, |most: f64, (_, c)| most.max(*c));
    let is_peak = |i: usize| {
        let below = |j: Option<usize>| j.and_then(|j| all.get(j)).is_none_or(|(_, c)| *c <= all[i].1);
        all[i].1 >= LIKELY_PEAK_SHARE * largest && below(i.checked_sub(1)) && below(Some(i + 1))
    };
    let mut peaks: Vec<(i64, f64)> = (0..all.len()).filter(|&i| is_peak(i)).map(|i| all[i]).collect();
    peaks.sort_by_key(|(lag, _)| lag.abs());
    let mut rising: Vec<(i64, f64)> = Vec::new();
    for peak in &peaks {
        if rising.last().is_none_or(|last| peak.1 > last.1 * (1.0 + ALIKE_COEFFICIENT_SHARE)) {
            rising.push(*peak);
        }
    }
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    let shortest = rising.iter().rev().take(MOST_LAGS);
    let mut lags: Vec<i64> = shortest.chain(peaks.iter().take(MOST_LAGS)).map(|(lag, _)| *lag).collect();
    lags.sort_by_key(|lag| lag.abs());
    lags.dedup();
    lags
}

/// The absolute correlation coefficient at each lag; 0 where too little overlaps.
fn coefficients(samples: &[f64], reference: &[f64]) -> Vec<(i64, f64)> {
    let [x, r] =
        [samples, reference].map(|part| Channel::new(&part[..part.len().min(SEARCHED)]).deviations());
    let correlation = fourier::cross_correlation(&x, &r);
    let (energies, others) = (sums_of_squares(&x), sums_of_squares(&r));
    let least = (x.len().min(r.len()) / LEAST_PART).max(1);
    let coefficient = |lag: i64| {
        let first = lag.max(0) as usize;
        let last = (r.len() as i64 + lag).clamp(0, x.len() as i64) as usize;
        if last < first + least {
            return (lag, 0.0);
        }
        let own = energies[last] - energies[first];
        let other = others[(last as i64 - lag) as usize] - others[(first as i64 - lag) as usize];
        let covariance = correlation[lag.rem_euclid(correlation.len() as i64) as usize];
        // An overlap of zeros correlates with nothing.
        (lag, if own > 0.0 && other > 0.0 { covariance.abs() / (own * other).sqrt() } else { 0.0 })
    };
    (1 - r.len() as i64..x.len() as i64).map(coefficient).collect()
}

/// Sums of the squares of the first 0, 1, 2, .. values.
fn sums_of_squares(values: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let next = values.iter().map(|x| {
        sum += x * x;
        sum
    });
    std::iter::once(0.0).chain(next).collect()
}
