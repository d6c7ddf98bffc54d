//! The error of FIR banks on fine grids of frequencies, one grid for each scenario. It gives a cheap
//! estimate of gamma while the taps are still being optimised.
//!
//! A scenario is a plant and a rule for its filters: the taps are matrices F_0, F_1, .. side by side, and
//! the filters of a scenario are `sum_k factors[k] F_k`. So its measurements are those of the plant times
//! each factor, one below another. A bank for known channels has one scenario with the factor 1. For the
//! exchange, scenarios are nothing but more frequencies: scenario s is put at 2 pi s + omega, where all
//! responses in whole lags are the same.

use super::DesignError;
use super::exchange::{AffineError, Peaks};
use super::filters;
use super::plant::LiftedPlant;
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lmi::sampled::{Point, Taps};
use crate::lti::peak::Peak;
use std::cell::OnceCell;
use std::f64::consts::{PI, TAU};
use std::sync::OnceLock;

/// Grid intervals for each slow lag: enough for the mean square of a polynomial of that degree to be exact.
const POINTS_PER_LAG: usize = 3;
/// Least number of these intervals: front ends have a memory, too.
const LEAST_POINTS: usize = 24;
/// The grid for peaks is finer by this factor.
pub(super) const FINE: usize = 8;
/// Where a level is given, every so many points are looked at first: six for each slow lag. Between two of
/// them, pi / (6 lags) apart, the gain falls from a maximum by 1 % at most (M. Riesz: cos(lags t / 2) with
/// t = pi / (12 lags)), and the memory of the front ends adds some.
const STRIDE: usize = FINE / 2;
/// Prune level: around points below this share of a level there is no peak above the level.
const PRUNE_LEVEL: f64 = 0.96;
/// Frequencies of a scenario lie in [0, pi]; half a radian keeps clear of the rounding at the ends.
const CLEAR_OF_ENDS: f64 = 0.5;

/// Intervals of the grid for mean squares, for filters of `lags` slow lags.
pub(super) fn coarse_intervals(lags: usize) -> usize {
    LEAST_POINTS.max(POINTS_PER_LAG * lags)
}

/// The errors of all scenarios at equidistant frequencies from 0 to pi. The plants' responses are computed
/// when they are needed: in most scenarios the error is far below that of the worst one.
pub(super) struct ErrorGrid<'a> {
    scenarios: Vec<Scenario<'a>>,
    intervals: usize,
    /// Columns of all responses.
    inputs: usize,
}

/// A plant with the rule for its filters.
pub(super) struct Scenario<'a> {
    /// The plant.
    pub(super) plant: &'a LiftedPlant,
    /// The factors of the unknowns.
    pub(super) factors: Vec<f64>,
    /// The error of this scenario counts times this.
    weight: f64,
    points: Vec<OnceLock<Point>>,
}

/// Taps with their responses on the grid that all scenarios share, computed when they are needed.
struct GridResponse<'t> {
    taps: &'t [Mat],
    values: Vec<OnceCell<CMat>>,
}

impl<'a> Scenario<'a> {
    /// A scenario of a grid.
    pub(super) fn new(plant: &'a LiftedPlant, factors: Vec<f64>, weight: f64) -> Self {
        Self { plant, factors, weight, points: Vec::new() }
    }

    fn at(&self, omega: f64) -> Point {
        let (h, w) = self.plant.response(omega);
        Point { omega, h, w }
    }

    /// The filters' response from that of the taps.
    fn filters(&self, taps: &CMat) -> CMat {
        let channels = taps.ncols() / self.factors.len();
        let part = |k: usize| taps.columns(k * channels, channels) * Complex::from(self.factors[k]);
        (1..self.factors.len()).fold(part(0), |sum, k| sum + part(k))
    }

    /// The measurements as the taps see them.
    fn stacked(&self, h: &CMat) -> CMat {
        let n = h.nrows();
        CMat::from_fn(n * self.factors.len(), h.ncols(), |row, column| {
            h[(row % n, column)] * Complex::from(self.weight * self.factors[row / n])
        })
    }
}

impl<'a> ErrorGrid<'a> {
    /// One plant, for filters of `lags` slow lags.
    pub(super) fn new(plant: &'a LiftedPlant, lags: usize) -> Self {
        Self::of_scenarios(vec![Scenario::new(plant, vec![1.0], 1.0)], lags)
    }

    /// Several scenarios.
    pub(super) fn of_scenarios(mut scenarios: Vec<Scenario<'a>>, lags: usize) -> Self {
        let intervals = FINE * coarse_intervals(lags);
        scenarios.iter_mut().for_each(|scenario| scenario.points = vec![OnceLock::new(); intervals + 1]);
        let mut grid = Self { scenarios, intervals, inputs: 0 };
        grid.inputs = (0..grid.scenarios.len()).map(|s| grid.point(s, 0).w.ncols()).max().unwrap_or(0);
        grid
    }

    /// The scenarios.
    pub(super) fn scenarios(&self) -> &[Scenario<'a>] {
        &self.scenarios
    }

    /// All points of the first scenario.
    pub(super) fn points(&self) -> Vec<Point> {
        (0..=self.intervals).map(|k| self.point(0, k).clone()).collect()
    }

    /// The coarser points of a scenario that suffice for a mean square, as points of the exchange, with
    /// their trapezoidal weights.
    pub(super) fn coarse(&self, scenario: usize) -> (Vec<Point>, Vec<f64>) {
        let points: Vec<Point> = (0..=self.intervals)
            .step_by(FINE)
            .map(|k| self.of_exchange(scenario, self.point(scenario, k)))
            .collect();
        let last = points.len() - 1;
        let mut weights = vec![1.0 / last as f64; points.len()];
        (weights[0], weights[last]) = (0.5 / last as f64, 0.5 / last as f64);
        (points, weights)
    }

    /// The gain of the first scenario's error with `taps` at each point.
    pub(super) fn gains(&self, taps: &[Mat]) -> Result<Vec<f64>, DesignError> {
        self.gains_about(0, &self.response(taps), 0.0)
    }

    /// The mean square of the first scenario's error per slow period, for white noise of unit density at the
    /// analog input.
    pub(super) fn mean_square(&self, taps: &[Mat]) -> f64 {
        let response = self.response(taps);
        let weight = |k: usize| if k == 0 || k == self.intervals { 0.5 } else { 1.0 };
        let square = |k: usize| weight(k) * self.error(0, k, &response).norm_squared();
        (0..=self.intervals).map(square).sum::<f64>() / self.intervals as f64
    }

    /// For each scenario the largest gain with `taps` at every fourth point.
    pub(super) fn estimates(&self, taps: &[Mat]) -> Result<Vec<f64>, DesignError> {
        let response = self.response(taps);
        let estimate = |s: usize| {
            let mut gains = (0..=self.intervals).step_by(STRIDE).map(|k| gain(&self.error(s, k, &response)));
            gains.try_fold(0.0, |most, gain| Ok(f64::max(most, gain?)))
        };
        (0..self.scenarios.len()).map(estimate).collect()
    }

    /// The peaks of the errors with `taps` above `level`. The estimate is that of gamma if gamma is above
    /// the level; else it is at most the level.
    pub(super) fn peaks(&self, taps: &[Mat], level: f64) -> Result<Peaks, DesignError> {
        let mut all = Peaks { estimate: 0.0, peaks: Vec::new() };
        let response = self.response(taps);
        for (s, scenario) in self.scenarios.iter().enumerate() {
            let found = self.scenario_peaks(s, &response, level / scenario.weight)?;
            all.estimate = all.estimate.max(scenario.weight * found.estimate);
            let of_exchange = |peak: Peak| Peak {
                frequency: peak.frequency + TAU * s as f64,
                gain: scenario.weight * peak.gain,
            };
            all.peaks.extend(found.peaks.into_iter().map(of_exchange).filter(|peak| peak.gain > level));
        }
        Ok(all)
    }

    fn scenario_peaks(&self, s: usize, taps: &GridResponse<'_>, level: f64) -> Result<Peaks, DesignError> {
        let gains = self.gains_about(s, taps, level)?;
        let most = gains.iter().copied().fold(0.0, f64::max);
        let scenario = &self.scenarios[s];
        let between = |omega| {
            let filters = scenario.filters(&filters::response(taps.taps, omega));
            gain(&error(&scenario.at(omega), &filters))
        };
        let found = peaks_between(&gains, self.frequency(1), PRUNE_LEVEL * level, between)?;
        Ok(Peaks { estimate: found.estimate.max(most), ..found })
    }

    /// The gains near points with gains about `level` or more; elsewhere smaller numbers.
    fn gains_about(&self, s: usize, taps: &GridResponse<'_>, level: f64) -> Result<Vec<f64>, DesignError> {
        let count = self.intervals + 1;
        let mut gains = vec![0.0; count];
        for k in (0..count).step_by(STRIDE) {
            let error = self.error(s, k, taps);
            // The Frobenius norm is no smaller than the gain and costs less.
            let bound = error.norm();
            gains[k] = if bound < PRUNE_LEVEL * level { bound } else { gain(&error)? };
        }
        let is_near = |k: usize| gains[k] >= PRUNE_LEVEL * level;
        let near: Vec<usize> = (0..count).step_by(STRIDE).filter(|&k| is_near(k)).collect();
        for &centre in &near {
            let first = centre.saturating_sub(STRIDE - 1);
            let around = &mut gains[first..(centre + STRIDE).min(count)];
            for (k, known) in around.iter_mut().enumerate().filter(|(_, known)| **known == 0.0) {
                *known = gain(&self.error(s, first + k, taps))?;
            }
        }
        Ok(gains)
    }

    fn response<'t>(&self, taps: &'t [Mat]) -> GridResponse<'t> {
        GridResponse { taps, values: vec![OnceCell::new(); self.intervals + 1] }
    }

    fn error(&self, s: usize, k: usize, taps: &GridResponse<'_>) -> CMat {
        let response = taps.values[k].get_or_init(|| filters::response(taps.taps, self.frequency(k)));
        error(self.point(s, k), &self.scenarios[s].filters(response))
    }

    fn point(&self, s: usize, k: usize) -> &Point {
        let scenario = &self.scenarios[s];
        scenario.points[k].get_or_init(|| scenario.at(self.frequency(k)))
    }

    fn frequency(&self, k: usize) -> f64 {
        PI * k as f64 / self.intervals as f64
    }

    /// A point of a scenario among those of all, with columns of zeros where a scenario with coinciding
    /// instants has fewer.
    fn of_exchange(&self, s: usize, point: &Point) -> Point {
        let pad = |m: CMat| m.resize_horizontally(self.inputs, Default::default());
        let scenario = &self.scenarios[s];
        let (w, h) = (&point.w * Complex::from(scenario.weight), scenario.stacked(&point.h));
        Point { omega: point.omega + TAU * s as f64, w: pad(w), h: pad(h) }
    }
}

impl AffineError for ErrorGrid<'_> {
    fn at(&self, omega: f64) -> Point {
        let s = (((omega + CLEAR_OF_ENDS) / TAU).floor() as usize).min(self.scenarios.len() - 1);
        let frequency = (omega - TAU * s as f64).clamp(0.0, PI);
        Point { omega, ..self.of_exchange(s, &self.scenarios[s].at(frequency)) }
    }

    fn peaks(&self, taps: &Taps, _gamma: f64, level: f64) -> Result<Peaks, DesignError> {
        // The estimate of a single scenario is compared with its norm, so it has to be one below the level
        // too.
        self.peaks(taps, if self.scenarios.len() == 1 { 0.0 } else { level })
    }
}

/// The local maxima above `level` of a gain that has the values `gains` at the multiples of `step` from 0 to
/// pi. `gain_at` computes it at any frequency. A parabola through three neighbouring grid points locates a
/// peak between them.
fn peaks_between(
    gains: &[f64],
    step: f64,
    level: f64,
    gain_at: impl Fn(f64) -> Result<f64, DesignError>,
) -> Result<Peaks, DesignError> {
    // The gain is even about 0 and about pi.
    let last = gains.len() - 1;
    let at = |k: isize| gains[last - (last as isize - k.abs()).unsigned_abs()];
    let mut peaks = Vec::new();
    for k in 0..=last as isize {
        if at(k) >= at(k - 1) && at(k) >= at(k + 1) && at(k) >= level {
            let (shift, _) = parabola(at(k - 1), at(k), at(k + 1));
            let frequency = ((k as f64 + shift) * step).clamp(0.0, PI);
            let between = gain_at(frequency)?;
            let point = Peak { gain: at(k), frequency: k as f64 * step };
            peaks.push(if between > point.gain { Peak { gain: between, frequency } } else { point });
        }
    }
    let estimate = peaks.iter().map(|peak| peak.gain).fold(0.0, f64::max);
    Ok(Peaks { estimate, peaks })
}

/// K = W - F H for the filters' response F.
fn error(point: &Point, filters: &CMat) -> CMat {
    &point.w - filters * &point.h
}

/// K at a point for the filters with the taps `lags`.
pub(super) fn error_at(point: &Point, lags: &[Mat]) -> CMat {
    error(point, &filters::response(lags, point.omega))
}

fn gain(error: &CMat) -> Result<f64, DesignError> {
    Ok(linalg::largest_singular_value(error)?)
}

/// Vertex of the parabola through (-1, a), (0, b), (1, c): abscissa and height.
fn parabola(a: f64, b: f64, c: f64) -> (f64, f64) {
    let curvature = a - 2.0 * b + c;
    if curvature >= 0.0 {
        return (0.0, b);
    }
    let shift = (0.5 * (a - c) / curvature).clamp(-1.0, 1.0);
    (shift, b - 0.25 * (a - c) * shift)
}

#[cfg(test)]
mod tests;
