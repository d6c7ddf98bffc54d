//! The error of a view of a rectified rig, rendered by rows.

use super::Evidence;
use super::estimate::{Calibration, Examined, Known, ViewError, calibrate, equalised, judge};
use super::evidence::survey;
use super::jitter::{depth_jitter, difference, disparity_noise, local_mean};
use super::regressors::regressors;
use super::sure::Limits;
use super::variogram::Variogram;
use crate::depth::DepthMap;
use crate::image::Image;
use crate::pipeline::{Agreement, RenderError, RenderSettings, Rendering, rectified as pipeline};
use crate::propagate::RectifiedView;

/// Errors of disparity reach this many standard deviations.
const REACH: f64 = 3.0;

/// The error of the view from `position` on the line of the cameras of a rectified rig, rendered by rows.
/// [`RigPredictor`] predicts several views, and the sure bound.
///
/// # Errors
/// Those of [`crate::pipeline::rectified::render`].
pub fn rectified(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
) -> Result<ViewError, RenderError> {
    RigPredictor::new(views, settings)?.at(position, None)
}

/// The views of a rectified rig with the weights that are calibrated on them, for any number of predictions.
pub struct RigPredictor<'a> {
    /// Photographs with one exposure.
    images: Vec<Image>,
    maps: Vec<(&'a DepthMap, f64)>,
    settings: RenderSettings,
    known: Known,
    calibration: Calibration,
    agreement: Agreement,
}

impl<'a> RigPredictor<'a> {
    /// Leaves each view out in turn and calibrates.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::rectified::render`].
    pub fn new(views: &[RectifiedView<'a>], settings: &RenderSettings) -> Result<Self, RenderError> {
        let agreement = Agreement::rectified(views);
        let gains = if settings.keep_exposure { &[][..] } else { &agreement.gains };
        let images = equalised(views.iter().map(|v| v.image), gains);
        let maps: Vec<_> = views.iter().map(|v| (v.disparity, v.position)).collect();
        let views = joined(&images, &maps);
        let settings = RenderSettings { keep_exposure: true, ..*settings };
        let known = Known { variogram: Variogram::of(images.iter()), noise: disparity_noise(&views) };
        let calibration = calibrate(&views, &known, |others, truth| {
            // A registration offset belongs to the virtual view only.
            let settings = RenderSettings { offset: 0.0, ..settings };
            let spacing = spacing(&views, truth.position);
            let examined = examine(others, truth.position, &settings, &known, spacing, None)?;
            let errors = difference(&examined.rendering.image.quantised(), truth.image);
            Ok((examined.regressors, errors))
        })?;
        Ok(Self { images, maps, settings, known, calibration, agreement })
    }

    /// How well the views agree, as they were given.
    pub fn agreement(&self) -> &Agreement {
        &self.agreement
    }

    /// The views, with one exposure.
    pub fn views(&self) -> Vec<RectifiedView<'_>> {
        joined(&self.images, &self.maps)
    }

    /// Mean distance between neighbouring views; of views at one place that from `position`, or one.
    pub fn spacing(&self, position: f64) -> f64 {
        spacing(&self.views(), position)
    }

    /// The error of the view from `position`; with limits also its sure bound.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::rectified::render`].
    pub fn at(&self, position: f64, limits: Option<&Limits>) -> Result<ViewError, RenderError> {
        let views = self.views();
        let examined =
            examine(&views, position, &self.settings, &self.known, spacing(&views, position), limits)?;
        Ok(judge(examined, self.calibration))
    }

    /// The view from `position`, as it is rendered from the views.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::rectified::render`].
    pub fn render(&self, position: f64) -> Result<Rendering, RenderError> {
        let settings = RenderSettings { offset: 0.0, ..self.settings };
        pipeline::render(&self.views(), position, &settings)
    }

    /// The local mean of the change of a rendered view if its disparities were `changed`, in grey levels.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::rectified::render`].
    pub fn change(
        &self,
        position: f64,
        rendered: &Image,
        changed: impl Fn(&DepthMap) -> DepthMap,
    ) -> Result<Vec<f32>, RenderError> {
        let maps: Vec<DepthMap> = self.maps.iter().map(|(map, _)| changed(map)).collect();
        let with = |(v, disparity)| RectifiedView { disparity, ..v };
        let views: Vec<RectifiedView<'_>> = self.views().into_iter().zip(&maps).map(with).collect();
        let image = pipeline::render(&views, position, &self.settings)?.image;
        Ok(local_mean(&difference(&image, rendered), image.size()))
    }

    /// The mean estimate of the view from `position` if `another` view were there too, with the weights as
    /// they are.
    ///
    /// # Errors
    /// Those of [`crate::pipeline::rectified::render`].
    pub fn with_view(&self, position: f64, another: &RectifiedView<'_>) -> Result<f64, RenderError> {
        let views = [self.views(), vec![*another]].concat();
        let spacing = spacing(&self.views(), position);
        let examined = examine(&views, position, &self.settings, &self.known, spacing, None)?;
        Ok(self.calibration.mean(&examined.regressors))
    }
}

fn joined<'a>(images: &'a [Image], maps: &[(&'a DepthMap, f64)]) -> Vec<RectifiedView<'a>> {
    let view = |(image, (disparity, position)): (&'a Image, &(&'a DepthMap, f64))| RectifiedView {
        image,
        disparity,
        position: *position,
    };
    images.iter().zip(maps).map(view).collect()
}

/// Mean distance between neighbouring views; for views at one place that of the virtual camera, or one.
fn spacing(views: &[RectifiedView<'_>], position: f64) -> f64 {
    let positions = || views.iter().map(|v| v.position);
    let (low, high) = positions().fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p), b.max(p)));
    let away = positions().map(|p| (p - position).abs()).fold(f64::MAX, f64::min);
    let candidates = [(high - low) / (views.len() as f64 - 1.0).max(1.0), away];
    candidates.into_iter().find(|s| *s > 0.0).unwrap_or(1.0)
}

fn examine(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
    known: &Known,
    spacing: f64,
    limits: Option<&Limits>,
) -> Result<Examined, RenderError> {
    let survey = survey(views, position, settings, limits)?;
    let jitter = depth_jitter(views, position, settings, &survey.rendering.image, known.noise)?;
    let regressors = regressors(&survey, &jitter, &known.variogram, spacing);
    let reach = (REACH * known.noise) as f32;
    let local_limit = survey.evidence.iter().map(|e| local_limit(e, reach)).collect();
    Ok(Examined { rendering: survey.rendering, regressors, sure_bound: survey.sure, local_limit })
}

/// The local limit of one pixel; `depth_error` bounds the error of disparities for a baseline of one.
fn local_limit(e: &Evidence, depth_error: f32) -> f32 {
    let geometry = e.steepest * (e.shift.abs() + depth_error * e.distance * e.reach);
    let curvature = e.sharpest / 2.0 * e.spread;
    let unseen = 255.0 * (1.0 - e.held).max(0.0);
    (geometry + curvature + e.residual * e.reach + unseen).min(255.0)
}
