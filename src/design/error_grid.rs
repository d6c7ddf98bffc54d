//! The error of FIR banks on fine grids of frequencies, one grid for each scenario. It gives a cheap
//! estimate of gamma while the taps are still being optimised.
//!
//! A scenario is a plant and a rule for its filters: the taps are matrices F_0, F_1, .. side by side, and
//! the filters of a scenario are `sum_k factors[k] F_k`. So its measurements are those of the plant times
//! each factor, one below another. A bank for known channels has one scenario with the factor 1.
//!
//! The grid is uniform, with further points at the resonances of the plant: beside a narrow one the error
//! may peak between two uniform points.

use super::DesignError;
use super::filters;
use super::plant::LiftedPlant;
use crate::linalg::{self, CMat, Complex, Mat};
use crate::lmi::sampled::{Point, Taps};
use crate::lti::peak::{Peak, local_maxima, refine};
use std::borrow::Cow;
use std::cell::OnceCell;
use std::f64::consts::PI;
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
pub(super) const PRUNE_LEVEL: f64 = 0.96;
/// Relative change of a gain at which the refinement of a peak between grid points ends: below the accuracy
/// of gamma, so that the peaks that become points are those of the error.
const FLAT_GAIN: f64 = 1e-8;
/// Further frequencies closer to an equidistant one than this share of their distance are left out.
const LEAST_SHARE: f64 = 1e-6;

/// Frequencies closer than this are one point, in radians.
const LEAST_DISTANCE: f64 = 1e-7;

/// Errors `K(omega) = W(omega) - sum_j e^{-i omega j} F_j H(omega)`, affine in the unknowns `F_j`: one for
/// each scenario, all with the same unknowns.
pub(super) trait AffineError {
    /// What tells the scenarios apart; `()` where there is one.
    type Scenario: Clone + PartialEq + std::fmt::Debug;

    /// W and H at a location.
    fn at(&self, location: &Location<Self::Scenario>) -> Point;

    /// The peaks of `sigma_max(K)` for the unknowns `taps`, whose largest value at the points is `gamma`.
    /// Peaks up to `level` may be left out.
    fn peaks(&self, taps: &Taps, gamma: f64, level: f64) -> Result<Peaks<Self::Scenario>, DesignError>;
}

/// A frequency in one of the scenarios.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Location<S> {
    /// Radians per lag.
    pub(super) frequency: f64,
    pub(super) scenario: S,
}

impl<S: PartialEq> Location<S> {
    pub(super) fn is_near(&self, other: &Self) -> bool {
        (self.frequency - other.frequency).abs() <= LEAST_DISTANCE && self.scenario == other.scenario
    }
}

/// A local maximum of `sigma_max(K)` over the frequencies.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LocatedPeak<S> {
    pub(super) gain: f64,
    pub(super) location: Location<S>,
}

/// Local maxima of `sigma_max(K)` over the frequencies.
#[derive(Debug, Clone)]
pub(super) struct Peaks<S> {
    /// Estimate of gamma; equal to gamma if no peak was missed.
    pub(super) estimate: f64,
    /// The peaks, in any order.
    pub(super) peaks: Vec<LocatedPeak<S>>,
}

impl<S: Clone> Peaks<S> {
    /// The locations of the peaks above `level`.
    pub(super) fn above(&self, level: f64) -> Vec<Location<S>> {
        self.peaks.iter().filter(|peak| peak.gain > level).map(|peak| peak.location.clone()).collect()
    }
}

/// Intervals of the grid for mean squares, for filters of `lags` slow lags.
pub(super) fn coarse_intervals(lags: usize) -> usize {
    LEAST_POINTS.max(POINTS_PER_LAG * lags)
}

/// The errors of all scenarios at frequencies from 0 to pi. The plants' responses are computed when they are
/// needed: in most scenarios the error is far below that of the worst one.
pub(super) struct ErrorGrid<'a> {
    scenarios: Vec<Scenario<'a>>,
    frequencies: Frequencies,
}

/// Frequencies from 0 to pi.
pub(super) struct Frequencies {
    /// Ascending: equidistant ones and some between them.
    pub(super) all: Vec<f64>,
    /// The indices of those that are looked at first: every so many of the equidistant ones, and all others.
    pub(super) first: Vec<usize>,
    /// The equidistant ones.
    uniform: Vec<usize>,
}

impl Frequencies {
    /// Those for filters of `lags` slow lags, and `further` ones.
    pub(super) fn new(lags: usize, further: &[f64]) -> Self {
        let intervals = FINE * coarse_intervals(lags);
        let uniform = (0..=intervals).map(|k| PI * k as f64 / intervals as f64);
        let is_new = |omega: &f64| {
            let place = omega * intervals as f64 / PI;
            (0.0..=PI).contains(omega) && (place - place.round()).abs() > LEAST_SHARE
        };
        let mut all: Vec<f64> = uniform.clone().chain(further.iter().copied().filter(is_new)).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        let mut rest = uniform.peekable();
        let is_uniform: Vec<bool> = all.iter().map(|omega| rest.next_if_eq(omega).is_some()).collect();
        let uniform: Vec<usize> = (0..all.len()).filter(|&k| is_uniform[k]).collect();
        let mut first: Vec<usize> = uniform.iter().copied().step_by(STRIDE).collect();
        first.extend((0..all.len()).filter(|&k| !is_uniform[k]));
        first.sort_unstable();
        Self { all, first, uniform }
    }
}

/// A plant with the rule for its filters.
pub(super) struct Scenario<'a> {
    /// The plant.
    pub(super) plant: Cow<'a, LiftedPlant>,
    /// The factors of the unknowns.
    pub(super) factors: Vec<f64>,
    /// The error of this scenario counts times this.
    pub(super) weight: f64,
    points: Vec<OnceLock<Point>>,
}

/// Taps with their responses on the grid that all scenarios share, computed when they are needed.
struct GridResponse<'t> {
    taps: &'t [Mat],
    values: Vec<OnceCell<CMat>>,
}

impl<'a> Scenario<'a> {
    /// A scenario of a grid.
    pub(super) fn new(plant: Cow<'a, LiftedPlant>, factors: Vec<f64>, weight: f64) -> Self {
        Self { plant, factors, weight, points: Vec::new() }
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
    ///
    /// # Errors
    /// As [`ErrorGrid::of_scenarios`].
    pub(super) fn new(plant: &'a LiftedPlant, lags: usize) -> Result<Self, DesignError> {
        Self::of_scenarios(vec![Scenario::new(Cow::Borrowed(plant), vec![1.0], 1.0)], lags)
    }

    /// Several scenarios.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if a plant is not stable.
    pub(super) fn of_scenarios(scenarios: Vec<Scenario<'a>>, lags: usize) -> Result<Self, DesignError> {
        // Errors of delays and gains do not move the poles.
        let frequencies = Frequencies::new(lags, scenarios[0].plant.resonances()?);
        let mut grid = Self { scenarios: Vec::new(), frequencies };
        scenarios.into_iter().for_each(|scenario| grid.add(scenario));
        Ok(grid)
    }

    /// Adds a scenario.
    pub(super) fn add(&mut self, scenario: Scenario<'a>) {
        let points = vec![OnceLock::new(); self.frequencies.all.len()];
        self.scenarios.push(Scenario { points, ..scenario });
    }

    /// The scenarios.
    pub(super) fn scenarios(&self) -> &[Scenario<'a>] {
        &self.scenarios
    }

    /// All points of the first scenario.
    pub(super) fn points(&self) -> Vec<Point> {
        (0..self.frequencies.all.len()).map(|k| self.point(0, k).clone()).collect()
    }

    /// The coarser points of a scenario that suffice for a mean square, as points of the exchange, with
    /// their trapezoidal weights.
    pub(super) fn coarse(&self, scenario: usize) -> (Vec<Point>, Vec<f64>) {
        let last = self.frequencies.uniform.len() / FINE;
        let at =
            |k: usize| self.of_exchange(scenario, self.point(scenario, self.frequencies.uniform[k * FINE]));
        let mut weights = vec![1.0 / last as f64; last + 1];
        (weights[0], weights[last]) = (0.5 / last as f64, 0.5 / last as f64);
        ((0..=last).map(at).collect(), weights)
    }

    /// The gain of the first scenario's error with `taps` at each point.
    pub(super) fn gains(&self, taps: &[Mat]) -> Result<Vec<f64>, DesignError> {
        self.gains_about(0, &self.response(taps), 0.0)
    }

    /// The mean square of the first scenario's error per slow period, for white noise of unit density at the
    /// analog input, by the trapezoidal rule on the equidistant frequencies.
    pub(super) fn mean_square(&self, taps: &[Mat]) -> f64 {
        let (response, weights) = (self.response(taps), self.mean_weights());
        let square = |k: usize| weights[k] * self.error(0, k, &response).norm_squared();
        self.frequencies.uniform.iter().map(|&k| square(k)).sum()
    }

    /// The weight of each point in [`Self::mean_square`].
    pub(super) fn mean_weights(&self) -> Vec<f64> {
        let Frequencies { all, uniform, .. } = &self.frequencies;
        let last = uniform.len() - 1;
        let mut weights = vec![0.0; all.len()];
        for (k, &index) in uniform.iter().enumerate() {
            weights[index] = if k == 0 || k == last { 0.5 } else { 1.0 } / last as f64;
        }
        weights
    }

    /// The peaks of the errors with `taps` above `level`. The estimate is that of gamma if gamma is above
    /// the level; else it is at most the level.
    pub(super) fn peaks(&self, taps: &[Mat], level: f64) -> Result<Peaks<usize>, DesignError> {
        let mut all = Peaks { estimate: 0.0, peaks: Vec::new() };
        let response = self.response(taps);
        for (s, scenario) in self.scenarios.iter().enumerate() {
            for peak in self.scenario_peaks(s, &response, level / scenario.weight)? {
                let gain = scenario.weight * peak.gain;
                all.estimate = all.estimate.max(gain);
                if gain > level {
                    let location = Location { frequency: peak.frequency, scenario: s };
                    all.peaks.push(LocatedPeak { gain, location });
                }
            }
        }
        Ok(all)
    }

    /// The local maxima above a share of `level`.
    fn scenario_peaks(
        &self,
        s: usize,
        taps: &GridResponse<'_>,
        level: f64,
    ) -> Result<Vec<Peak>, DesignError> {
        let gains = self.gains_about(s, taps, level)?;
        let grid: Vec<Peak> = gains
            .into_iter()
            .zip(&self.frequencies.all)
            .map(|(gain, &frequency)| Peak { gain, frequency })
            .collect();
        let scenario = &self.scenarios[s];
        let at = |frequency: f64| {
            let filters = scenario.filters(&filters::response(taps.taps, frequency));
            Ok(Peak { gain: gain(&scenario.plant.at(frequency).error(&filters))?, frequency })
        };
        let maxima = local_maxima(&grid).into_iter().filter(|[_, peak, _]| peak.gain >= PRUNE_LEVEL * level);
        maxima.map(|around| refine(at, around, FLAT_GAIN)).collect()
    }

    /// The gains near points with gains about `level` or more; elsewhere smaller numbers.
    fn gains_about(&self, s: usize, taps: &GridResponse<'_>, level: f64) -> Result<Vec<f64>, DesignError> {
        let mut gains = vec![0.0; self.frequencies.all.len()];
        for &k in &self.frequencies.first {
            let error = self.error(s, k, taps);
            // The Frobenius norm is no smaller than the gain and costs less.
            let bound = error.norm();
            gains[k] = if bound < PRUNE_LEVEL * level { bound } else { gain(&error)? };
        }
        for pair in self.frequencies.first.windows(2) {
            if gains[pair[0]].max(gains[pair[1]]) >= PRUNE_LEVEL * level {
                let between = pair[0] + 1..pair[1];
                for (k, known) in between.clone().zip(&mut gains[between]) {
                    *known = gain(&self.error(s, k, taps))?;
                }
            }
        }
        Ok(gains)
    }

    fn response<'t>(&self, taps: &'t [Mat]) -> GridResponse<'t> {
        GridResponse { taps, values: vec![OnceCell::new(); self.frequencies.all.len()] }
    }

    fn error(&self, s: usize, k: usize, taps: &GridResponse<'_>) -> CMat {
        let response = taps.values[k].get_or_init(|| filters::response(taps.taps, self.frequencies.all[k]));
        self.point(s, k).error(&self.scenarios[s].filters(response))
    }

    fn point(&self, s: usize, k: usize) -> &Point {
        let scenario = &self.scenarios[s];
        scenario.points[k].get_or_init(|| scenario.plant.at(self.frequencies.all[k]))
    }

    /// A point of a scenario among those of all, with columns of zeros where a scenario with coinciding
    /// instants has fewer.
    fn of_exchange(&self, s: usize, point: &Point) -> Point {
        let scenario = &self.scenarios[s];
        let inputs = scenario.plant.channels() + scenario.plant.ratio();
        let pad = |m: CMat| m.resize_horizontally(inputs, Default::default());
        let (w, h) = (&point.w * Complex::from(scenario.weight), scenario.stacked(&point.h));
        Point { omega: point.omega, w: pad(w), h: pad(h) }
    }
}

impl AffineError for ErrorGrid<'_> {
    type Scenario = usize;

    fn at(&self, location: &Location<usize>) -> Point {
        let s = location.scenario;
        self.of_exchange(s, &self.scenarios[s].plant.at(location.frequency))
    }

    fn peaks(&self, taps: &Taps, gamma: f64, level: f64) -> Result<Peaks<usize>, DesignError> {
        // The estimate of a single scenario is compared with its norm, so it has to be one below the level
        // too.
        let found = self.peaks(taps, if self.scenarios.len() == 1 { 0.0 } else { level })?;
        Ok(Peaks { estimate: found.estimate.max(gamma), ..found })
    }
}

fn gain(error: &CMat) -> Result<f64, DesignError> {
    Ok(linalg::largest_singular_value(error)?)
}

#[cfg(test)]
mod tests;
