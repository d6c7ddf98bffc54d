//! The three numbers of every pixel, from the evidence and the calibrated weights.

use super::Cause;
use super::calibrate::LeastSquares;
use super::examine::{examine, spacing};
use super::regressors::{CAUSE_OF, REGRESSORS, Regressors, difference};
use super::variogram::Variogram;
use crate::pipeline::{Geometry, RenderError, RenderSettings, Rendering};
use crate::propagate::View;
use std::ops::Range;

/// Weights of the mean absolute error for photographs, from "Cones" and "Teddy": bend, noise, slope, jitter,
/// edge, hole.
const TYPICAL: Regressors = [0.9, 1.6, 0.12, 1.0, 0.08, 1.2];

/// Weights of the mean square: those of a normal error of that mean, with heavier tails where the depth is
/// in doubt.
const TYPICAL_SQUARE: Regressors = [1.5, 9.0, 0.03, 1.6, 0.1, 3.0];

/// Views that are left out, at most; each costs a rendering.
const LEFT_OUT: usize = 4;

/// A prior as strong as this many grey levels squared per pixel.
const PRIOR: f64 = 1e-3;

/// The weights of the causes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    absolute: Regressors,
    square: Regressors,
    /// Views that were left out to find the weights; 0 where typical ones are used.
    pub views: usize,
    /// Standard deviation of the disparities' errors, in pixels for a baseline of one; for general cameras
    /// that of the relative errors of depth.
    pub disparity_noise: f64,
}

/// The error of a view, pixel by pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewError {
    /// The rendering.
    pub rendering: Rendering,
    /// Expected bound: the root mean square, in grey levels, row by row.
    pub expected: Vec<f32>,
    /// Expected absolute error.
    pub estimate: Vec<f32>,
    /// Mean over the view of the part of the estimate that each cause has, in the order of [`Cause::ALL`].
    pub causes: [f64; 5],
    /// The weights.
    pub calibration: Calibration,
}

/// Figures of a whole view, in grey levels unless named.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Totals {
    /// Root mean square: the expected bound of the mean absolute error.
    pub expected: f64,
    /// Mean absolute error.
    pub estimate: f64,
    /// PSNR in dB that belongs to `expected`.
    pub psnr: f64,
}

impl ViewError {
    /// Figures of the whole view.
    pub fn totals(&self) -> Totals {
        self.over(0..self.estimate.len())
    }

    /// Figures of each row.
    pub fn rows(&self) -> Vec<Totals> {
        let (width, height) = self.rendering.image.size();
        (0..height).map(|y| self.over(y * width..(y + 1) * width)).collect()
    }

    fn over(&self, pixels: Range<usize>) -> Totals {
        let mean = |values: &[f32], power: i32| {
            values.iter().map(|v| f64::from(*v).powi(power)).sum::<f64>() / values.len() as f64
        };
        let square = mean(&self.expected[pixels.clone()], 2);
        Totals {
            expected: square.sqrt(),
            estimate: mean(&self.estimate[pixels], 1),
            psnr: 10.0 * (255.0 * 255.0 / square).log10(),
        }
    }

    /// The cause of the largest part of the estimate.
    pub fn dominant(&self) -> Cause {
        let parts = Cause::ALL.into_iter().zip(self.causes);
        parts.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(Cause::Density, |(cause, _)| cause)
    }
}

/// What renderings are examined with.
pub(super) struct Study {
    pub(super) settings: RenderSettings,
    pub(super) variogram: Variogram,
    /// Standard deviation of the errors of disparity, or of the relative errors of depth.
    pub(super) noise: f64,
}

/// What is found of a rendering before its causes are weighed.
pub(super) struct Examined {
    pub(super) rendering: Rendering,
    pub(super) regressors: Vec<Regressors>,
}

/// Expected error, estimate and causes from the regressors and their weights.
pub(super) fn judge(examined: Examined, calibration: Calibration) -> ViewError {
    let Examined { rendering, regressors } = examined;
    let mut causes = [0.0; 5];
    let (mut expected, mut estimate) = (Vec::new(), Vec::new());
    for x in &regressors {
        let parts = calibration.parts(x);
        let squares: f64 = (0..REGRESSORS).map(|k| calibration.square[k] * x[k] * x[k]).sum();
        for (part, cause) in parts.iter().zip(CAUSE_OF) {
            causes[cause as usize] += part / regressors.len() as f64;
        }
        let mean: f64 = parts.iter().sum();
        estimate.push(mean as f32);
        expected.push(squares.sqrt().max(mean) as f32);
    }
    ViewError { rendering, expected, estimate, causes, calibration }
}

impl Calibration {
    /// Leaves views out in turn, renders them from the others and explains the errors by the causes.
    pub(super) fn of<P: Geometry>(views: &[View<'_, P>], study: &Study) -> Result<Self, RenderError> {
        let (mut absolute, mut square) = (LeastSquares::default(), LeastSquares::default());
        let used = if views.len() < 2 { 0 } else { views.len().min(LEFT_OUT) };
        for k in 0..used {
            let mut others = views.to_vec();
            let truth = others.remove(k * views.len() / used);
            let spacing = spacing(views, &truth.camera);
            let examined = examine(&others, &truth.camera, truth.image.size(), study, spacing)?;
            let errors = difference(&examined.rendering.image.quantised(), truth.image);
            for (x, error) in examined.regressors.iter().zip(errors) {
                absolute.add(x, f64::from(error));
                square.add(&x.map(|v| v * v), f64::from(error * error));
            }
        }
        Ok(Self {
            absolute: absolute.solve(&TYPICAL, PRIOR),
            square: square.solve(&TYPICAL_SQUARE, PRIOR),
            views: used,
            disparity_noise: study.noise,
        })
    }

    /// What each regressor adds to the estimate of a pixel.
    fn parts(&self, x: &Regressors) -> Regressors {
        std::array::from_fn(|k| self.absolute[k] * x[k])
    }

    /// The mean estimate over the pixels with these regressors.
    pub(super) fn mean(&self, regressors: &[Regressors]) -> f64 {
        let of_pixel = |x: &Regressors| self.parts(x).iter().sum::<f64>();
        regressors.iter().map(of_pixel).sum::<f64>() / regressors.len() as f64
    }
}
