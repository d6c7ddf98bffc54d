//! The errors of all scenarios as one error on one long stretch of frequencies.

use super::scenario_grid::ScenarioGrid;
use crate::design::DesignError;
use crate::design::exchange::{AffineError, Peaks};
use crate::linalg::{CMat, Complex, Mat};
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
    /// The filters of this scenario.
    fn filters(&self, taps: &Taps) -> Taps {
        let mixed = |lag: &Mat| {
            let channels = lag.ncols() / self.factors.len();
            let part = |k: usize| lag.columns(k * channels, channels);
            let sum = part(0) * self.factors[0];
            (1..self.factors.len()).fold(sum, |sum, k| sum + part(k) * self.factors[k])
        };
        taps.iter().map(mixed).collect()
    }

    fn stacked(&self, h: &CMat) -> CMat {
        let n = h.nrows();
        CMat::from_fn(n * self.factors.len(), h.ncols(), |row, column| {
            h[(row % n, column)] * Complex::from(self.weight * self.factors[row / n])
        })
    }
}

impl Sheets<'_> {
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
        for (number, sheet) in self.sheets.iter().enumerate() {
            let Peaks { estimate, peaks } = sheet.grid.peaks(&sheet.filters(taps), level / sheet.weight)?;
            all.estimate = all.estimate.max(sheet.weight * estimate);
            let shifted = |peak: Peak| Peak {
                frequency: peak.frequency + TAU * number as f64,
                gain: sheet.weight * peak.gain,
            };
            // Of each scenario the highest peak: the others mostly fall with it.
            let peaks = peaks.into_iter().map(shifted).filter(|peak| peak.gain > level);
            all.peaks.extend(peaks.max_by(|a, b| a.gain.total_cmp(&b.gain)));
        }
        Ok(all)
    }
}
