//! The error of a view of a rectified rig, rendered by rows.

use super::estimate::{Examined, Predicted, Study};
use super::evidence::collect;
use super::jitter::depth_jitter;
use super::regressors::{regressors, slopes};
use crate::pipeline::{RenderError, RenderSettings, Rendering, rectified as pipeline};
use crate::propagate::RectifiedView;

/// Distance in pixels over which a colour of doubtful depth is wrong, for the variogram.
const DOUBT: usize = 4;

impl Predicted for f64 {
    fn render(
        &self,
        views: &[RectifiedView<'_>],
        _: (usize, usize),
        settings: &RenderSettings,
    ) -> Result<Rendering, RenderError> {
        pipeline::render(views, *self, settings)
    }

    fn examine(
        &self,
        views: &[RectifiedView<'_>],
        size: (usize, usize),
        study: &Study,
        spacing: f64,
    ) -> Result<Examined, RenderError> {
        let settings = &study.settings;
        let rendering = self.render(views, size, settings)?;
        let evidence = collect(views, *self, settings, &rendering)?;
        let jitter = depth_jitter(views, self, settings, &rendering.image, study.noise)?;
        let slopes = slopes(&rendering.image);
        let of_seen = |p: usize| {
            let e = &evidence[p];
            // The noise of the photograph that a view is compared with adds to that of the views.
            let noise = (1.0 + f64::from(e.views)).sqrt();
            // Displacements of the samples: one part grows with the distance to the views, and one does not.
            let disparity_gain = f64::from(e.disparity_gain) / (spacing * spacing);
            let displacement = ((f64::from(e.views) + disparity_gain) / 2.0).sqrt();
            [
                f64::from(e.bias),
                noise,
                f64::from(slopes[p]) * displacement,
                f64::from(jitter[p]),
                f64::from(e.edge),
                f64::from(e.doubtful) * study.variogram.at(DOUBT),
                0.0,
            ]
        };
        let regressors = regressors(&rendering, &study.variogram, of_seen);
        Ok(Examined { rendering, regressors })
    }

    fn check_memory(
        &self,
        views: &[RectifiedView<'_>],
        _: (usize, usize),
        settings: &RenderSettings,
    ) -> Result<(), RenderError> {
        let extent = pipeline::extent(views, settings);
        extent.check(extent.of_rig_prediction())
    }

    fn spacing(&self, views: &[RectifiedView<'_>]) -> f64 {
        let positions = || views.iter().map(|v| v.camera);
        let (low, high) = positions().fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p), b.max(p)));
        let away = positions().map(|p| (p - self).abs()).fold(f64::MAX, f64::min);
        let candidates = [(high - low) / (views.len() as f64 - 1.0).max(1.0), away];
        candidates.into_iter().find(|s| *s > 0.0).unwrap_or(1.0)
    }
}
