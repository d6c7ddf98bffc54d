//! The error of an FIR bank on a fine grid of frequencies. It gives a cheap estimate of gamma while the taps
//! are still being optimised.
//!
//! The grid is uniform, with further points at the resonances of the plant: beside a narrow one the error
//! may peak between two uniform points.

use super::DesignError;
use super::plant::LiftedPlant;
use crate::lmi::sampled::FrequencyPoint;
use crate::lti::FirMatrix;
use crate::lti::peak::{Peak, local_maxima, refine};
use hybank_linalg::CMat;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// What the grid takes for one frequency, one gain or no peak.
pub(super) struct Settings {
    /// Around points below this share of a level there is no peak above the level: see [`STRIDE`].
    pub(super) prune_level: f64,
    /// Relative change of a gain at which the refinement of a peak between grid points ends: below the
    /// accuracy of gamma, so that the peaks that become points are those of the error.
    pub(super) flat_gain: f64,
    /// Further frequencies closer to an equidistant one than this share of their distance are left out:
    /// their errors are the same.
    pub(super) least_share: f64,
    /// Frequencies closer than this are one point, in radians: rows of the problem that differ by rounding
    /// do not help.
    pub(super) least_distance: f64,
}

/// Of every grid.
pub(super) const SETTINGS: Settings =
    Settings { prune_level: 0.96, flat_gain: 1e-8, least_share: 1e-6, least_distance: 1e-7 };

/// Grid intervals for each slow lag: enough for the mean square of a polynomial of that degree to be exact.
const POINTS_PER_LAG: usize = 3;
/// Least number of these intervals: front ends have a memory, too.
const LEAST_POINTS: usize = 24;
/// The grid for peaks is finer by this factor.
const FINE: usize = 8;
/// Where a level is given, every so many points are looked at first: six for each slow lag. Between two of
/// them, pi / (6 lags) apart, the gain falls from a maximum by 1 % at most (M. Riesz: cos(lags t / 2) with
/// t = pi / (12 lags)), and the memory of the front ends adds some.
const STRIDE: usize = FINE / 2;

/// Errors `K(omega) = W(omega) - sum_j e^{-i omega j} F_j H(omega)`, affine in the unknowns `F_j`: one for
/// each scenario, all with the same unknowns.
pub(super) trait AffineError {
    /// What tells the scenarios apart; `()` where there is one.
    type Scenario: Clone + PartialEq + std::fmt::Debug;

    /// W and H at a location.
    fn at(&self, location: &GridFrequency<Self::Scenario>) -> FrequencyPoint;

    /// The local maxima of `sigma_max(K)` over the frequencies for the unknowns `taps`, in any order. Those
    /// up to `level` may be left out.
    fn peaks(&self, taps: &FirMatrix, level: f64) -> Result<Vec<LocatedPeak<Self::Scenario>>, DesignError>;
}

/// A frequency in one of the scenarios.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct GridFrequency<S> {
    /// Radians per lag.
    pub(super) frequency: f64,
    pub(super) scenario: S,
}

impl<S: PartialEq> GridFrequency<S> {
    pub(super) fn is_near(&self, other: &Self) -> bool {
        (self.frequency - other.frequency).abs() <= SETTINGS.least_distance && self.scenario == other.scenario
    }
}

/// A local maximum of `sigma_max(K)` over the frequencies.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LocatedPeak<S> {
    pub(super) gain: f64,
    pub(super) location: GridFrequency<S>,
}

impl From<Peak> for LocatedPeak<()> {
    fn from(Peak { gain, frequency }: Peak) -> Self {
        Self { gain, location: GridFrequency { frequency, scenario: () } }
    }
}

/// Intervals of the grid for mean squares, for filters of `lags` slow lags.
fn coarse_intervals(lags: usize) -> usize {
    LEAST_POINTS.max(POINTS_PER_LAG * lags)
}

/// The error at frequencies from 0 to pi. The plant's responses are computed when they are needed.
pub(super) struct ErrorGrid<'a> {
    plant: &'a LiftedPlant,
    frequencies: Frequencies,
    points: Vec<OnceLock<FrequencyPoint>>,
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
            (0.0..=PI).contains(omega) && (place - place.round()).abs() > SETTINGS.least_share
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

impl<'a> ErrorGrid<'a> {
    /// The error of `plant`, for filters of `lags` slow lags.
    ///
    /// # Errors
    /// [`DesignError::Lti`] if the plant is not stable.
    pub(super) fn new(plant: &'a LiftedPlant, lags: usize) -> Result<Self, DesignError> {
        let frequencies = Frequencies::new(lags, &plant.resonances()?);
        let points = vec![OnceLock::new(); frequencies.all.len()];
        Ok(Self { plant, frequencies, points })
    }

    /// All points.
    pub(super) fn points(&self) -> Vec<FrequencyPoint> {
        (0..self.frequencies.all.len()).map(|k| self.point(k).clone()).collect()
    }

    /// The coarser points that suffice for a mean square, with their trapezoidal weights.
    pub(super) fn coarse(&self) -> (Vec<FrequencyPoint>, Vec<f64>) {
        let last = self.frequencies.uniform.len() / FINE;
        let at = |k: usize| self.point(self.frequencies.uniform[k * FINE]).clone();
        let mut weights = vec![1.0 / last as f64; last + 1];
        (weights[0], weights[last]) = (0.5 / last as f64, 0.5 / last as f64);
        ((0..=last).map(at).collect(), weights)
    }

    /// The gain of the error with `taps` at each point.
    pub(super) fn gains(&self, taps: &FirMatrix) -> Result<Vec<f64>, DesignError> {
        (0..self.frequencies.all.len()).map(|k| gain(&self.error(k, taps))).collect()
    }

    /// The mean square of the error per slow period, for white noise of unit density at the analog input, by
    /// the trapezoidal rule on the equidistant frequencies.
    pub(super) fn mean_square(&self, taps: &FirMatrix) -> f64 {
        let weights = self.mean_weights();
        let square = |k: usize| weights[k] * self.error(k, taps).norm_squared();
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

    /// An estimate of the gamma of `taps`: the largest of the maxima.
    ///
    /// # Errors
    /// [`DesignError::Linalg`] if a decomposition does not converge.
    pub(super) fn gamma(&self, taps: &FirMatrix) -> Result<f64, DesignError> {
        Ok(self.maxima(taps)?.iter().map(|peak| peak.gain).fold(0.0, f64::max))
    }

    /// The local maxima of the error with `taps`.
    fn maxima(&self, taps: &FirMatrix) -> Result<Vec<Peak>, DesignError> {
        let grid = self.gains(taps)?.into_iter().zip(&self.frequencies.all);
        let grid: Vec<Peak> = grid.map(|(gain, &frequency)| Peak { gain, frequency }).collect();
        let at = |frequency: f64| {
            let error = self.plant.at(frequency).error(&taps.response(frequency));
            Ok(Peak { gain: gain(&error)?, frequency })
        };
        local_maxima(&grid).into_iter().map(|around| refine(at, around, SETTINGS.flat_gain)).collect()
    }

    fn error(&self, k: usize, taps: &FirMatrix) -> CMat {
        self.point(k).error(&taps.response(self.frequencies.all[k]))
    }

    fn point(&self, k: usize) -> &FrequencyPoint {
        self.points[k].get_or_init(|| self.plant.at(self.frequencies.all[k]))
    }
}

impl AffineError for ErrorGrid<'_> {
    type Scenario = ();

    fn at(&self, location: &GridFrequency<()>) -> FrequencyPoint {
        self.plant.at(location.frequency)
    }

    /// All of them: the largest is compared with the norm, so it has to be one below the level too.
    fn peaks(&self, taps: &FirMatrix, _level: f64) -> Result<Vec<LocatedPeak<()>>, DesignError> {
        Ok(self.maxima(taps)?.into_iter().map(LocatedPeak::from).collect())
    }
}

fn gain(error: &CMat) -> Result<f64, DesignError> {
    Ok(hybank_linalg::largest_singular_value(error)?)
}

#[cfg(test)]
mod tests;
