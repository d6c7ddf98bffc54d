//! The error of FIR banks on a fine grid of frequencies. It gives a cheap estimate of gamma while the taps
//! are still being optimised.

use super::DesignError;
use super::exchange::{AffineError, Peaks};
use super::filters;
use super::plant::LiftedPlant;
use crate::linalg::{self, CMat, Mat};
use crate::lmi::sampled::{Point, Taps};
use crate::lti::peak::Peak;
use std::f64::consts::PI;

/// Grid intervals for each slow lag: enough for the mean square of a polynomial of that degree to be exact.
const POINTS_PER_LAG: usize = 3;
const LEAST_POINTS: usize = 24;
/// The grid for peaks is finer by this factor.
pub(super) const FINE: usize = 8;

/// Intervals of the grid for mean squares, for filters of `lags` slow lags.
pub(super) fn coarse_intervals(lags: usize) -> usize {
    LEAST_POINTS.max(POINTS_PER_LAG * lags)
}

/// Intervals of the grid for peaks.
pub(super) fn intervals(lags: usize) -> usize {
    FINE * coarse_intervals(lags)
}

/// Trapezoidal weights of the coarser points that suffice for a mean square.
pub(super) fn trapezoidal_weights(count: usize) -> Vec<f64> {
    let last = count - 1;
    let mut weights = vec![1.0 / last as f64; count];
    (weights[0], weights[last]) = (0.5 / last as f64, 0.5 / last as f64);
    weights
}

/// A plant at equidistant frequencies from 0 to pi.
pub(super) struct ErrorGrid<'a> {
    plant: &'a LiftedPlant,
    points: Vec<Point>,
}

impl<'a> ErrorGrid<'a> {
    /// A grid for filters of `lags` slow lags.
    pub(super) fn new(plant: &'a LiftedPlant, lags: usize) -> Self {
        let intervals = intervals(lags);
        let mut grid = Self { plant, points: Vec::new() };
        grid.points = (0..=intervals).map(|k| grid.at(PI * k as f64 / intervals as f64)).collect();
        grid
    }

    /// All points.
    pub(super) fn points(&self) -> &[Point] {
        &self.points
    }

    /// The coarser points that suffice for a mean square, with their trapezoidal weights.
    pub(super) fn coarse(&self) -> (Vec<Point>, Vec<f64>) {
        let points: Vec<Point> = self.points.iter().step_by(FINE).cloned().collect();
        let weights = trapezoidal_weights(points.len());
        (points, weights)
    }

    /// The plant at any frequency (radians per slow period).
    pub(super) fn at(&self, omega: f64) -> Point {
        let (h, w) = self.plant.response(omega);
        Point { omega, h, w }
    }

    /// The gain of the error with `taps` at each point.
    pub(super) fn gains(&self, taps: &[Mat]) -> Result<Vec<f64>, DesignError> {
        self.points.iter().map(|point| gain(point, taps)).collect()
    }

    /// The mean square of the error per slow period, for white noise of unit density at the analog input.
    pub(super) fn mean_square(&self, taps: &[Mat]) -> f64 {
        let last = self.points.len() - 1;
        let weight = |k: usize| if k == 0 || k == last { 0.5 } else { 1.0 };
        let square = |(k, point)| weight(k) * error_at(point, taps).norm_squared();
        self.points.iter().enumerate().map(square).sum::<f64>() / last as f64
    }

    /// The peaks of the error with `taps`. A parabola through three neighbouring grid points locates a peak
    /// between them.
    pub(super) fn peaks(&self, taps: &[Mat]) -> Result<Peaks, DesignError> {
        let gains = self.gains(taps)?;
        peaks_between(&gains, self.points[1].omega, 0.0, |omega| gain(&self.at(omega), taps))
    }
}

/// The local maxima above `level` of a gain that has the values `gains` at the multiples of `step` from 0 to
/// pi. `gain_at` computes it at any frequency.
pub(super) fn peaks_between(
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

impl AffineError for ErrorGrid<'_> {
    fn at(&self, omega: f64) -> Point {
        self.at(omega)
    }

    fn peaks(&self, taps: &Taps, _gamma: f64, _level: f64) -> Result<Peaks, DesignError> {
        self.peaks(taps)
    }
}

/// K = W - F H at a point.
pub(super) fn error_at(point: &Point, taps: &[Mat]) -> CMat {
    &point.w - filters::response(taps, point.omega) * &point.h
}

/// The largest singular value of K at a point.
pub(super) fn gain(point: &Point, taps: &[Mat]) -> Result<f64, DesignError> {
    Ok(linalg::largest_singular_value(&error_at(point, taps))?)
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
