//! The error of any number of views, with weights that are calibrated once.

use super::estimate::{Calibration, Known, Predicted, Study, ViewError, equalised, judge};
use super::jitter::map_noise;
use super::lookup::local_limits;
use super::regressors::{difference, local_mean};
use super::variogram::Variogram;
use crate::depth::DepthMap;
use crate::image::Image;
use crate::pipeline::{Agreement, RenderError, RenderSettings, Rendering, without_drift};
use crate::propagate::View;

/// Views with the weights that are calibrated on them, for any number of predictions.
pub struct Predictor<'a, P> {
    /// Photographs with one exposure.
    images: Vec<Image>,
    maps: Vec<(&'a DepthMap, P)>,
    settings: RenderSettings,
    known: Known,
    calibration: Calibration,
    agreement: Agreement,
}

impl<'a, P: Predicted> Predictor<'a, P> {
    /// Leaves each view out in turn and calibrates.
    ///
    /// # Errors
    /// Those of [`crate::pipeline`].
    pub fn new(views: &[View<'a, P>], settings: &RenderSettings) -> Result<Self, RenderError> {
        if let Some(first) = views.first() {
            first.camera.check_memory(views, first.image.size(), settings)?;
        }
        let agreement = Agreement::of(views);
        let gains = if settings.keep_exposure { Vec::new() } else { without_drift(&agreement.gains) };
        let images = equalised(views.iter().map(|v| v.image), &gains);
        let maps: Vec<_> = views.iter().map(|v| (v.map, v.camera)).collect();
        let views = joined(&images, &maps);
        let settings = RenderSettings { keep_exposure: true, ..*settings };
        let known = Known { variogram: Variogram::of(images.iter()), noise: map_noise(&views) };
        // A registration offset belongs to the virtual view only.
        let unmoved = RenderSettings { offset: 0.0, ..settings };
        let calibration = Calibration::of(&views, &unmoved, &known)?;
        Ok(Self { images, maps, settings, known, calibration, agreement })
    }

    /// How well the views agree, as they were given.
    pub fn agreement(&self) -> &Agreement {
        &self.agreement
    }

    /// The weights of the causes.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The views, with one exposure.
    pub fn views(&self) -> Vec<View<'_, P>> {
        joined(&self.images, &self.maps)
    }

    fn study(&self, camera: &P) -> Study<'_> {
        let spacing = camera.spacing(&self.views());
        Study { settings: &self.settings, known: &self.known, spacing }
    }

    /// The error of the view of `camera`.
    ///
    /// # Errors
    /// Those of [`crate::pipeline`].
    pub fn at(&self, camera: &P, size: (usize, usize)) -> Result<ViewError, RenderError> {
        let views = self.views();
        camera.check_memory(&views, size, &self.settings)?;
        let examined = camera.examine(&views, size, &self.study(camera))?;
        let local_limit = local_limits(&views, camera, &examined.rendering, self.known.noise);
        Ok(judge(examined, local_limit, self.calibration))
    }

    /// The view of `camera`, as it is rendered from the views.
    pub(super) fn render(&self, camera: &P, size: (usize, usize)) -> Result<Rendering, RenderError> {
        camera.render(&self.views(), size, &RenderSettings { offset: 0.0, ..self.settings })
    }

    /// The local mean of the change of a rendered view if its maps were `changed`, in grey levels.
    pub(super) fn change(
        &self,
        camera: &P,
        rendered: &Image,
        changed: impl Fn(&DepthMap) -> DepthMap,
    ) -> Result<Vec<f32>, RenderError> {
        let maps: Vec<DepthMap> = self.maps.iter().map(|(map, _)| changed(map)).collect();
        let views: Vec<_> = self.views().into_iter().zip(&maps).map(|(v, map)| View { map, ..v }).collect();
        let image = camera.render(&views, rendered.size(), &self.settings)?.image;
        Ok(local_mean(&difference(&image, rendered), image.size()))
    }

    /// The mean estimate of the view of `camera` from other views: some of those of the predictor, or more.
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
        let examined = camera.examine(views, size, &self.study(camera))?;
        Ok(self.calibration.mean(&examined.regressors))
    }
}

fn joined<'a, P: Copy>(images: &'a [Image], maps: &[(&'a DepthMap, P)]) -> Vec<View<'a, P>> {
    images.iter().zip(maps).map(|(image, &(map, camera))| View { image, map, camera }).collect()
}
