//! The filters of all scenarios on the grid of frequencies that the scenarios share: the response of the
//! taps is computed once and not for each scenario.

use crate::design::filters;
use crate::linalg::{CMat, Complex};
use crate::lmi::sampled::Taps;
use std::cell::OnceCell;
use std::f64::consts::PI;

/// The frequencies of a grid of `count` points.
pub(super) fn grid_frequency(k: usize, count: usize) -> f64 {
    PI * k as f64 / (count - 1) as f64
}

/// The responses of some taps at the points of a grid, computed when they are needed.
pub(super) struct GridResponse<'a> {
    taps: &'a Taps,
    values: Vec<OnceCell<CMat>>,
}

impl<'a> GridResponse<'a> {
    /// On a grid of `count` points.
    pub(super) fn new(taps: &'a Taps, count: usize) -> Self {
        Self { taps, values: vec![OnceCell::new(); count] }
    }

    fn at(&self, k: usize) -> &CMat {
        let frequency = grid_frequency(k, self.values.len());
        self.values[k].get_or_init(|| filters::response(self.taps, frequency))
    }
}

/// The filters of one scenario. The taps are matrices F_0, F_1, .. side by side, and the filters are
/// `sum_k factors[k] F_k`.
#[derive(Clone, Copy)]
pub(super) struct GridFilters<'a> {
    pub(super) response: &'a GridResponse<'a>,
    pub(super) factors: &'a [f64],
}

impl GridFilters<'_> {
    /// Their response at a point of the grid.
    pub(super) fn at(&self, k: usize) -> CMat {
        self.mixed(self.response.at(k))
    }

    /// Their response at any frequency.
    pub(super) fn between(&self, omega: f64) -> CMat {
        self.mixed(&filters::response(self.response.taps, omega))
    }

    fn mixed(&self, response: &CMat) -> CMat {
        let channels = response.ncols() / self.factors.len();
        let part = |k: usize| response.columns(k * channels, channels) * Complex::from(self.factors[k]);
        (1..self.factors.len()).fold(part(0), |sum, k| sum + part(k))
    }
}
