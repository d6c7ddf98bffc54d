//! The error of any number of views, with weights that are calibrated once.

use super::estimate::{Calibration, Study, ViewError, judge};
use super::examine::{examine, spacing};
use super::jitter::map_noise;
use super::variogram::Variogram;
use crate::depth::DepthMap;
use crate::image::Image;
use crate::pipeline::{Agreement, Exposure, Geometry, RenderError, RenderSettings, without_drift};
use crate::propagate::View;

/// Views with the weights that are calibrated on them, for any number of predictions.
pub struct Predictor<'a, P> {
    /// Photographs with one exposure.
    images: Vec<Image>,
    maps: Vec<(&'a DepthMap, P)>,
    study: Study,
    calibration: Calibration,
    /// How well the views agree, as they were given.
    pub agreement: Agreement,
}

impl<'a, P: Geometry> Predictor<'a, P> {
    /// Leaves each view out in turn and calibrates.
    ///
    /// # Errors
    /// Those of [`crate::pipeline`].
    pub fn new(views: &[View<'a, P>], settings: &RenderSettings) -> Result<Self, RenderError> {
        let agreement = Agreement::of(views);
        let gains = if settings.keep_exposure { Vec::new() } else { without_drift(&agreement.gains) };
        let images = equalised(views, &gains);
        let maps: Vec<_> = views.iter().map(|v| (v.map, v.camera)).collect();
        let views = joined(&images, &maps);
        // A registration offset belongs to the virtual view only.
        let unmoved = RenderSettings { keep_exposure: true, offset: 0.0, ..*settings };
        let mut study =
            Study { settings: unmoved, variogram: Variogram::of(&images), noise: map_noise(&views) };
        let calibration = Calibration::of(&views, &study)?;
        study.settings.offset = settings.offset;
        Ok(Self { images, maps, study, calibration, agreement })
    }

    /// The views, with one exposure.
    pub fn views(&self) -> Vec<View<'_, P>> {
        joined(&self.images, &self.maps)
    }

    /// The error of the view of `camera`.
    ///
    /// # Errors
    /// Those of [`crate::pipeline`].
    pub fn at(&self, camera: &P, size: (usize, usize)) -> Result<ViewError, RenderError> {
        let views = self.views();
        let examined = examine(&views, camera, size, &self.study, spacing(&views, camera))?;
        Ok(judge(examined, self.calibration))
    }

    /// The mean estimate of the view of `camera` from some of the views, or from others.
    /// The weights and the distance between views stay as they are.
    ///
    /// # Errors
    /// Those of [`crate::pipeline`].
    pub fn estimate_from(
        &self,
        views: &[View<'_, P>],
        camera: &P,
        size: (usize, usize),
    ) -> Result<f64, RenderError> {
        let examined = examine(views, camera, size, &self.study, spacing(&self.views(), camera))?;
        Ok(self.calibration.mean(&examined.regressors))
    }
}

/// Photographs with one exposure.
fn equalised<P>(views: &[View<'_, P>], gains: &[Exposure]) -> Vec<Image> {
    let scaled = |(i, view): (usize, &View<'_, P>)| {
        let (mut image, gain) =
            (view.image.clone(), gains.get(i).map_or([1.0; 3], |gain| gain.map(|g| g as f32)));
        let channels = image.channels();
        image.data_mut().iter_mut().enumerate().for_each(|(k, v)| *v *= gain[k % channels]);
        image
    };
    views.iter().enumerate().map(scaled).collect()
}

fn joined<'a, P: Copy>(images: &'a [Image], maps: &[(&'a DepthMap, P)]) -> Vec<View<'a, P>> {
    images.iter().zip(maps).map(|(image, &(map, camera))| View { image, map, camera }).collect()
}
