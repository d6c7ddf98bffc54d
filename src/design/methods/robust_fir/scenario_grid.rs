//! The error of one scenario on a fine grid of frequencies, of which only the part near its peaks is
//! computed: at most of the scenarios the error is far below that of the worst one.

use super::grid_filters::{GridFilters, grid_frequency};
use crate::design::DesignError;
use crate::design::error_grid::{FINE, intervals, peaks_between, trapezoidal_weights};
use crate::design::exchange::Peaks;
use crate::design::plant::LiftedPlant;
use crate::linalg::{self, CMat};
use crate::lmi::sampled::Point;
use std::cell::OnceCell;

/// Every so many points are looked at first: six for each slow lag. Between two of them, pi / (6 lags)
/// apart, the gain falls from a maximum by 1 % at most (M. Riesz: cos(lags t / 2) with t = pi / (12 lags)),
/// and the memory of the front ends adds some.
const STRIDE: usize = FINE / 2;
/// Around points below this share of the level there is no peak above the level.
const NEAR: f64 = 0.96;

/// A plant at equidistant frequencies from 0 to pi, computed when they are needed.
pub(super) struct ScenarioGrid<'a> {
    plant: &'a LiftedPlant,
    points: Vec<OnceCell<Point>>,
}

impl<'a> ScenarioGrid<'a> {
    /// A grid for filters of `lags` slow lags.
    pub(super) fn new(plant: &'a LiftedPlant, lags: usize) -> Self {
        Self { plant, points: vec![OnceCell::new(); intervals(lags) + 1] }
    }

    /// The plant.
    pub(super) fn plant(&self) -> &'a LiftedPlant {
        self.plant
    }

    /// The plant at any frequency (radians per slow period).
    pub(super) fn at(&self, omega: f64) -> Point {
        let (h, w) = self.plant.response(omega);
        Point { omega, h, w }
    }

    /// Points that suffice for a mean square, with their trapezoidal weights.
    pub(super) fn coarse(&self) -> (Vec<Point>, Vec<f64>) {
        let points: Vec<Point> =
            (0..self.points.len()).step_by(FINE).map(|k| self.point(k).clone()).collect();
        let weights = trapezoidal_weights(points.len());
        (points, weights)
    }

    /// The number of points.
    pub(super) fn count(&self) -> usize {
        self.points.len()
    }

    /// The largest gain at every fourth point.
    pub(super) fn estimate(&self, filters: &GridFilters<'_>) -> Result<f64, DesignError> {
        let mut gains = (0..self.count()).step_by(STRIDE).map(|k| gain(&self.error(k, filters)));
        gains.try_fold(0.0, |most, gain| Ok(f64::max(most, gain?)))
    }

    /// The peaks of the error with these filters that are above `level`. The estimate is that of gamma if
    /// gamma is above the level; else it is at most the level.
    pub(super) fn peaks(&self, filters: &GridFilters<'_>, level: f64) -> Result<Peaks, DesignError> {
        let gains = self.gains(filters, level)?;
        let most = gains.iter().copied().fold(0.0, f64::max);
        let between = |omega| gain(&error(&self.at(omega), &filters.between(omega)));
        let found = peaks_between(&gains, self.frequency(1), NEAR * level, between)?;
        Ok(Peaks { estimate: found.estimate.max(most), ..found })
    }

    /// The gains near points with gains about `level` or more; elsewhere smaller numbers.
    fn gains(&self, filters: &GridFilters<'_>, level: f64) -> Result<Vec<f64>, DesignError> {
        let count = self.count();
        let mut gains = vec![0.0; count];
        for k in (0..count).step_by(STRIDE) {
            let error = self.error(k, filters);
            // The Frobenius norm is no smaller than the gain and costs less.
            let bound = error.norm();
            gains[k] = if bound < NEAR * level { bound } else { gain(&error)? };
        }
        let is_near = |k: usize| gains[k] >= NEAR * level;
        let near: Vec<usize> = (0..count).step_by(STRIDE).filter(|&k| is_near(k)).collect();
        for &centre in &near {
            let first = centre.saturating_sub(STRIDE - 1);
            let around = &mut gains[first..(centre + STRIDE).min(count)];
            for (k, known) in around.iter_mut().enumerate().filter(|(_, known)| **known == 0.0) {
                *known = gain(&self.error(first + k, filters))?;
            }
        }
        Ok(gains)
    }

    fn error(&self, k: usize, filters: &GridFilters<'_>) -> CMat {
        error(self.point(k), &filters.at(k))
    }

    fn point(&self, k: usize) -> &Point {
        self.points[k].get_or_init(|| self.at(self.frequency(k)))
    }

    fn frequency(&self, k: usize) -> f64 {
        grid_frequency(k, self.count())
    }
}

/// K = W - F H for the filters' response F.
fn error(point: &Point, filters: &CMat) -> CMat {
    &point.w - filters * &point.h
}

fn gain(error: &CMat) -> Result<f64, DesignError> {
    Ok(linalg::largest_singular_value(error)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::error_grid::ErrorGrid;
    use crate::design::methods::robust_fir::grid_filters::GridResponse;
    use crate::design::problem::Problem;
    use crate::linalg::Mat;
    use crate::lmi::sampled::Taps;
    use crate::random::Random;
    use crate::spec::Spec;

    /// Against the grid that computes all points: the highest peak has the same bits wherever it is above
    /// the level, and nothing above the level is missed.
    #[test]
    fn the_highest_peak_is_that_of_the_whole_grid() {
        let spec = Spec::from_toml(include_str!("../../../../filters/thesis-fir.toml"), "spec.toml").unwrap();
        let plant = LiftedPlant::new(&Problem::new(&spec, 10).unwrap()).unwrap();
        let mut random = Random(5);
        for lags in [1, 3, 11] {
            let (whole, part) = (ErrorGrid::new(&plant, lags), ScenarioGrid::new(&plant, lags));
            for _ in 0..8 {
                let taps: Taps = (0..lags).map(|_| Mat::from_fn(2, 2, |_, _| random.sample())).collect();
                let highest = |peaks: &Peaks| {
                    peaks.peaks.iter().copied().max_by(|a, b| a.gain.total_cmp(&b.gain)).unwrap()
                };
                let all = whole.peaks(&taps).unwrap();
                let response = GridResponse::new(&taps, part.count());
                let filters = GridFilters { response: &response, factors: &[1.0] };
                for level in [0.0, 0.5, 0.9, 0.999].map(|share| share * all.estimate) {
                    let some = part.peaks(&filters, level).unwrap();
                    assert_eq!(
                        (highest(&some), some.estimate),
                        (highest(&all), all.estimate),
                        "{lags} {level}"
                    );
                }
                assert!(part.peaks(&filters, 1.01 * all.estimate).unwrap().estimate <= 1.01 * all.estimate);
                let estimate = part.estimate(&filters).unwrap();
                assert!(estimate <= all.estimate && estimate > 0.97 * all.estimate, "{estimate}");
            }
        }
    }
}
