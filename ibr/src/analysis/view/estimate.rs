//! The three numbers of every pixel, from the survey and the calibrated weights.

use super::calibrate::LeastSquares;
use super::jitter::{depth_jitter, difference, disparity_noise};
use super::regressors::{CAUSE_OF, REGRESSORS, Regressors, regressors};
use super::survey::{Survey, survey};
use super::variogram::Variogram;
use super::{Cause, Evidence};
use crate::image::Image;
use crate::pipeline::{Agreement, RenderError, RenderSettings, Rendering};
use crate::propagate::RectifiedView;

/// Weights of the mean absolute error for photographs, from "Cones": bias, noise, slope, jitter, edge,
/// doubt, hole.
const TYPICAL: Regressors = [0.9, 2.3, 0.12, 1.0, 0.08, 0.5, 1.2];

/// Weights of the mean square: those of a normal error of that mean, with heavier tails where the depth is
/// in doubt.
const TYPICAL_SQUARE: Regressors = [1.5, 9.0, 0.03, 1.6, 0.1, 1.5, 3.0];

/// Views that are left out, at most; each costs a rendering.
const LEFT_OUT: usize = 4;

/// A prior as strong as this many grey levels squared per pixel.
const PRIOR: f64 = 1e-3;

/// Errors of disparity reach this many standard deviations.
const REACH: f64 = 3.0;

/// Error of two values that are both rounded.
const ROUNDING: f32 = 1.0;

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
    /// Local bound of each pixel, in grey levels, row by row; empty for general cameras.
    pub local_bound: Vec<f32>,
    /// Expected bound: the root mean square.
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
    /// Mean of the local bounds; none for general cameras.
    pub local_bound: Option<f64>,
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
        Totals::over(&self.local_bound, &self.expected, &self.estimate)
    }

    /// Figures of each row.
    pub fn rows(&self) -> Vec<Totals> {
        let width = self.rendering.image.width();
        let bounds = self.local_bound.chunks(width).chain(std::iter::repeat(&[][..]));
        let rows = self.expected.chunks(width).zip(self.estimate.chunks(width)).zip(bounds);
        rows.map(|((expected, estimate), bound)| Totals::over(bound, expected, estimate)).collect()
    }

    /// Share of the pixels whose error against a photograph of the same size is within the local bound,
    /// after rounding to 8 bits; none if there is no local bound.
    pub fn within_local_bound(&self, truth: &Image) -> Option<f64> {
        let errors = difference(&self.rendering.image.quantised(), truth);
        let within =
            errors.iter().zip(&self.local_bound).filter(|(error, bound)| **error <= **bound + ROUNDING);
        let all = self.local_bound.len();
        (all > 0).then(|| within.count() as f64 / all as f64)
    }

    /// The cause of the largest part of the estimate.
    pub fn dominant(&self) -> Cause {
        let parts = Cause::ALL.into_iter().zip(self.causes);
        parts.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(Cause::Density, |(cause, _)| cause)
    }
}

impl Totals {
    fn over(bound: &[f32], expected: &[f32], estimate: &[f32]) -> Self {
        let mean = |values: &[f32], power: i32| {
            values.iter().map(|v| f64::from(*v).powi(power)).sum::<f64>() / values.len() as f64
        };
        let square = mean(expected, 2);
        Self {
            local_bound: (!bound.is_empty()).then(|| mean(bound, 1)),
            expected: square.sqrt(),
            estimate: mean(estimate, 1),
            psnr: 10.0 * (255.0 * 255.0 / square).log10(),
        }
    }
}

/// The error of the view from `position` on the line of the cameras of a rectified rig, rendered by rows.
///
/// # Errors
/// Those of [`crate::pipeline::rectified::render`].
pub fn rectified(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
) -> Result<ViewError, RenderError> {
    let gains = if settings.keep_exposure { Vec::new() } else { Agreement::rectified(views).gains };
    let images = equalised(views.iter().map(|v| v.image), &gains);
    let views: Vec<RectifiedView<'_>> =
        views.iter().zip(&images).map(|(v, image)| RectifiedView { image, ..*v }).collect();
    let settings = RenderSettings { keep_exposure: true, ..*settings };
    let variogram = Variogram::of(images.iter());
    let noise = disparity_noise(&views);
    let known = Known { variogram, noise, spacing: spacing(&views, position) };
    let calibration = calibrate(&views, &known, |others, truth| {
        // A registration offset belongs to the virtual view only.
        let settings = RenderSettings { offset: 0.0, ..settings };
        let examined = examine(others, truth.position, &settings, &known)?;
        Ok((examined.regressors, difference(&examined.survey.rendering.image.quantised(), truth.image)))
    })?;
    let Examined { survey, regressors } = examine(&views, position, &settings, &known)?;
    let reach = (REACH * calibration.disparity_noise) as f32;
    let bounds = survey.evidence.iter().map(|e| local_bound(e, reach)).collect();
    Ok(judge(survey.rendering, &regressors, calibration, bounds))
}

/// What is known of the views together.
pub(super) struct Known {
    pub(super) variogram: Variogram,
    /// Standard deviation of the errors of disparity, or of the relative errors of depth.
    pub(super) noise: f64,
    /// Distance between neighbouring views.
    pub(super) spacing: f64,
}

/// Mean distance between neighbouring views; for views at one place that of the virtual camera, or one.
fn spacing(views: &[RectifiedView<'_>], position: f64) -> f64 {
    let positions = || views.iter().map(|v| v.position);
    let (low, high) = positions().fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p), b.max(p)));
    let away = positions().map(|p| (p - position).abs()).fold(f64::MAX, f64::min);
    let candidates = [(high - low) / (views.len() as f64 - 1.0).max(1.0), away];
    candidates.into_iter().find(|s| *s > 0.0).unwrap_or(1.0)
}

/// A survey with its regressors.
struct Examined {
    survey: Survey,
    regressors: Vec<Regressors>,
}

fn examine(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
    known: &Known,
) -> Result<Examined, RenderError> {
    let survey = survey(views, position, settings)?;
    let jitter = depth_jitter(views, position, settings, &survey.rendering.image, known.noise)?;
    let regressors = regressors(&survey, &jitter, &known.variogram, known.spacing);
    Ok(Examined { survey, regressors })
}

/// Photographs with one exposure.
pub(super) fn equalised<'a>(images: impl Iterator<Item = &'a Image>, gains: &[f64]) -> Vec<Image> {
    let scaled = |(i, image): (usize, &Image)| {
        let (mut image, gain) = (image.clone(), gains.get(i).map_or(1.0, |g| *g as f32));
        image.data_mut().iter_mut().for_each(|v| *v *= gain);
        image
    };
    images.enumerate().map(scaled).collect()
}

/// Leaves views out in turn and explains the errors of their renderings by the causes. `examine` renders a
/// view from the others and gives regressors and errors of its pixels.
pub(super) fn calibrate<View: Copy>(
    views: &[View],
    known: &Known,
    examine: impl Fn(&[View], &View) -> Result<(Vec<Regressors>, Vec<f32>), RenderError>,
) -> Result<Calibration, RenderError> {
    let (mut absolute, mut square) = (LeastSquares::default(), LeastSquares::default());
    let used = if views.len() < 2 { 0 } else { views.len().min(LEFT_OUT) };
    for k in 0..used {
        let mut others = views.to_vec();
        let truth = others.remove(k * views.len() / used);
        let (regressors, errors) = examine(&others, &truth)?;
        for (x, error) in regressors.iter().zip(errors) {
            absolute.add(x, f64::from(error));
            square.add(&x.map(|v| v * v), f64::from(error * error));
        }
    }
    Ok(Calibration {
        absolute: absolute.solve(&TYPICAL, PRIOR),
        square: square.solve(&TYPICAL_SQUARE, PRIOR),
        views: used,
        disparity_noise: known.noise,
    })
}

/// Expected error, estimate and causes from the regressors and their weights.
pub(super) fn judge(
    rendering: Rendering,
    regressors: &[Regressors],
    calibration: Calibration,
    local_bound: Vec<f32>,
) -> ViewError {
    let mut causes = [0.0; 5];
    let (mut expected, mut estimate) = (Vec::new(), Vec::new());
    for x in regressors {
        let parts: Regressors = std::array::from_fn(|k| calibration.absolute[k] * x[k]);
        let squares: f64 = (0..REGRESSORS).map(|k| calibration.square[k] * x[k] * x[k]).sum();
        for (part, cause) in parts.iter().zip(CAUSE_OF) {
            causes[cause as usize] += part / regressors.len() as f64;
        }
        let mean: f64 = parts.iter().sum();
        estimate.push(mean as f32);
        expected.push(squares.sqrt().max(mean) as f32);
    }
    ViewError { rendering, local_bound, expected, estimate, causes, calibration }
}

/// The local bound of one pixel; `depth_error` bounds the error of disparities for a baseline of one.
fn local_bound(e: &Evidence, depth_error: f32) -> f32 {
    let geometry = e.steepest * (e.shift.abs() + depth_error * e.distance * e.reach);
    let curvature = e.sharpest / 2.0 * e.spread;
    let unseen = 255.0 * (1.0 - e.held).max(0.0);
    (geometry + curvature + e.residual * e.reach + unseen).min(255.0)
}
