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
        study: &Study<'_>,
    ) -> Result<Examined, RenderError> {
        let Study { settings, known, spacing } = *study;
        let rendering = self.render(views, size, settings)?;
        let evidence = collect(views, *self, settings, &rendering)?;
        let jitter = depth_jitter(views, self, settings, &rendering.image, known.noise)?;
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
                f64::from(e.doubtful) * known.variogram.at(DOUBT),
                0.0,
            ]
        };
        let regressors = regressors(&rendering, &known.variogram, of_seen);
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

    /// Half-way between the virtual camera and its neighbour on either side, or on a side without one as far
    /// away as the nearest view.
    fn further(&self, views: &[RectifiedView<'_>]) -> Vec<(Vec<f64>, f64)> {
        let nearest = |side: f64| {
            let away = views.iter().map(|v| side * (v.camera - self)).filter(|away| *away > 0.0);
            Some(away.fold(f64::INFINITY, f64::min)).filter(|away| away.is_finite())
        };
        let (below, above) = (nearest(-1.0), nearest(1.0));
        let away = |own: Option<f64>, other: Option<f64>| {
            own.map(|d| d / 2.0).or(other).unwrap_or_else(|| self.spacing(views))
        };
        [self - away(below, above), self + away(above, below)]
            .map(|position| (vec![position], position))
            .into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::{DepthMap, Measure};
    use crate::image::Image;

    #[test]
    fn further_views_lie_between_neighbours_or_opposite_of_them() {
        let image = Image::filled(1, 1, 1, 0.0);
        let map = DepthMap::new((1, 1), vec![1.0], 1.0, Measure::Disparity).unwrap();
        for (positions, at, want) in [
            (&[0.0, 1.0, 4.0][..], 0.5, [0.25, 0.75]),
            (&[0.0, 1.0], 3.0, [2.0, 5.0]),
            (&[2.0], 2.0, [1.0, 3.0]),
        ] {
            let view = |camera: &f64| RectifiedView { image: &image, map: &map, camera: *camera };
            let views: Vec<_> = positions.iter().map(view).collect();
            let found: Vec<f64> = at.further(&views).into_iter().map(|(_, position)| position).collect();
            assert_eq!(found, want);
        }
    }
}
