//! The errors of all scenarios as one error on one long stretch of frequencies.

use super::grid_filters::{GridFilters, GridResponse};
use super::scenario_grid::ScenarioGrid;
use crate::design::DesignError;
use crate::design::exchange::{AffineError, Peaks};
use crate::linalg::{CMat, Complex};
use crate::lmi::sampled::{Point, Taps};
use crate::lti::peak::Peak;
use std::f64::consts::{PI, TAU};

/// The errors of all scenarios, each on its own stretch of frequencies.
pub(super) struct Sheets<'a> {
    pub(super) sheets: Vec<Sheet<'a>>,
    /// Columns of all responses.
    pub(super) inputs: usize,
}

/// One scenario. The unknowns are matrices F_0, F_1, .. side by side, and the filters of this scenario are
/// `sum_k factors[k] F_k`; so its measurements are those of the plant, times each factor, one below another.
pub(super) struct Sheet<'a> {
    pub(super) grid: ScenarioGrid<'a>,
    pub(super) factors: Vec<f64>,
    /// The error of this scenario counts times this.
    pub(super) weight: f64,
}

impl Sheet<'_> {
    fn stacked(&self, h: &CMat) -> CMat {
        let n = h.nrows();
        CMat::from_fn(n * self.factors.len(), h.ncols(), |row, column| {
            h[(row % n, column)] * Complex::from(self.weight * self.factors[row / n])
        })
    }
}

impl Sheets<'_> {
    /// The response of some taps on the grid of all sheets.
    pub(super) fn response<'t>(&self, taps: &'t Taps) -> GridResponse<'t> {
        GridResponse::new(taps, self.sheets[0].grid.count())
    }

    /// A point of a sheet's grid among those of all, with columns of zeros where a scenario with coinciding
    /// instants has fewer.
    pub(super) fn point(&self, sheet: usize, point: &Point) -> Point {
        let pad = |m: CMat| m.resize_horizontally(self.inputs, Default::default());
        let Sheet { weight, .. } = self.sheets[sheet];
        let (w, h) = (&point.w * Complex::from(weight), self.sheets[sheet].stacked(&point.h));
        Point { omega: point.omega + TAU * sheet as f64, w: pad(w), h: pad(h) }
    }
}

impl AffineError for Sheets<'_> {
    fn at(&self, omega: f64) -> Point {
        // Frequencies lie in [0, pi] of their stretch; half a radian keeps clear of the rounding at its
        // ends.
        let sheet = (((omega + 0.5) / TAU).floor() as usize).min(self.sheets.len() - 1);
        let frequency = (omega - TAU * sheet as f64).clamp(0.0, PI);
        Point { omega, ..self.point(sheet, &self.sheets[sheet].grid.at(frequency)) }
    }

    fn peaks(&self, taps: &Taps, _gamma: f64, level: f64) -> Result<Peaks, DesignError> {
        let mut all = Peaks { estimate: 0.0, peaks: Vec::new() };
        let response = self.response(taps);
        for (number, sheet) in self.sheets.iter().enumerate() {
            let filters = GridFilters { response: &response, factors: &sheet.factors };
            let Peaks { estimate, peaks } = sheet.grid.peaks(&filters, level / sheet.weight)?;
            all.estimate = all.estimate.max(sheet.weight * estimate);
            let shifted = |peak: Peak| Peak {
                frequency: peak.frequency + TAU * number as f64,
                gain: sheet.weight * peak.gain,
            };
            all.peaks.extend(peaks.into_iter().map(shifted).filter(|peak| peak.gain > level));
        }
        Ok(all)
    }
}
