//! The values of one channel from its equations.

use super::super::error::CalibrateError;
use super::super::estimates::covariance;
use super::super::model::Model;
use super::super::parameters::{Fit, Kind};
use crate::linalg::{Complex, Mat};

/// Steps of the cut-off; the equations are linear in the other values.
const STEPS: usize = 12;
/// A cut-off that is known to less than this share of itself is not known.
const LARGEST_CUTOFF_ERROR: f64 = 0.1;

/// The two equations of one tone.
pub(super) struct Row {
    /// Rad per fast period.
    pub(super) w: f64,
    /// ln |ratio|.
    pub(super) magnitude: f64,
    /// Its phase, without whole turns of the nearest delay.
    pub(super) phase: f64,
    /// Their standard deviations.
    pub(super) sigmas: (f64, f64),
}

/// The equations of a channel.
pub(super) struct Equations {
    /// From 0.
    pub(super) channel: usize,
    pub(super) rows: Vec<Row>,
    pub(super) fit: Fit,
}

/// The values in the order of [`Fit::kinds`].
pub(super) struct Solution {
    pub(super) values: Vec<f64>,
    pub(super) covariance: Mat,
    /// Chi squared, and its degrees of freedom.
    pub(super) squares: f64,
    pub(super) freedom: usize,
}

impl Equations {
    pub(super) fn solve(&self, model: &Model) -> Result<Solution, CalibrateError> {
        let kinds = self.fit.kinds();
        let mut values = vec![0.0; kinds.len()];
        if kinds.is_empty() {
            return Ok(Solution { values, covariance: Mat::zeros(0, 0), squares: 0.0, freedom: 0 });
        }
        let cutoff = kinds.iter().position(|&kind| kind == Kind::Cutoff);
        let steps = if cutoff.is_some() { STEPS } else { 1 };
        let mut last = None;
        for _ in 0..steps {
            let ln_cutoff = cutoff.map_or(0.0, |k| values[k]);
            let (design, rest) = self.weighted(model, &kinds, &values, ln_cutoff);
            let transposed = design.transpose();
            let covariance = covariance(&(&transposed * &design)).ok_or(CalibrateError::NotIdentifiable)?;
            let step = &covariance * (transposed * &rest);
            let left = &rest - &design * &step;
            values.iter_mut().zip(step.iter()).for_each(|(value, step)| *value += step);
            last = Some((covariance, left.dot(&left), left.len() - kinds.len().min(left.len())));
        }
        let Some((covariance, squares, freedom)) = last else { return Err(CalibrateError::NotIdentifiable) };
        if let Some(k) = cutoff {
            self.check_cutoff(covariance[(k, k)].sqrt(), values[k])?;
        }
        Ok(Solution { values, covariance, squares, freedom })
    }

    /// Derivatives by the values, and what the values leave, each over its standard deviation.
    fn weighted(&self, model: &Model, kinds: &[Kind], values: &[f64], ln_cutoff: f64) -> (Mat, Mat) {
        let magnitudes = self.fit.gain || self.fit.cutoff;
        let phases = self.fit.delay || self.fit.cutoff;
        let (mut design, mut rest) = (Vec::new(), Vec::new());
        for row in &self.rows {
            let slope = model.cutoff_slope(self.channel, row.w, ln_cutoff);
            let bend = self.bend(model, row.w, ln_cutoff);
            let effect = |kind: Kind| match kind {
                Kind::Delay => Complex::new(0.0, -row.w),
                Kind::Gain => Complex::new(1.0, 0.0),
                Kind::Cutoff => slope,
            };
            let linear: Complex<f64> = kinds
                .iter()
                .zip(values)
                .filter(|(k, _)| **k != Kind::Cutoff)
                .map(|(&k, v)| effect(k) * *v)
                .sum();
            let left = Complex::new(row.magnitude, row.phase) - linear - bend;
            let mut push = |part: fn(Complex<f64>) -> f64, sigma: f64| {
                design.extend(kinds.iter().map(|&kind| part(effect(kind)) / sigma));
                rest.push(part(left) / sigma);
            };
            if magnitudes {
                push(|x| x.re, row.sigmas.0);
            }
            if phases {
                push(|x| x.im, row.sigmas.1);
            }
        }
        let rows = rest.len();
        (Mat::from_row_slice(rows, kinds.len(), &design), Mat::from_vec(rows, 1, rest))
    }

    /// ln (Phi(j w / c) / Phi(j w)).
    fn bend(&self, model: &Model, w: f64, ln_cutoff: f64) -> Complex<f64> {
        (model.response(self.channel, w, ln_cutoff) / model.response(self.channel, w, 0.0)).ln()
    }

    fn check_cutoff(&self, sigma: f64, value: f64) -> Result<(), CalibrateError> {
        if sigma <= LARGEST_CUTOFF_ERROR && value.abs() <= 1.0 {
            return Ok(());
        }
        Err(CalibrateError::CutoffLooksLikeDelay { channel: self.channel + 1, sigma })
    }
}
