//! Virtual views of rectified rigs: the three stages run row by row, rows in parallel.

use super::nearness::SHARING;
use super::{
    Agreement, Geometry, RenderError, RenderSettings, Renderer, Rendering, Report, Stages, ViewWeights,
    Visible, check_counts, check_size,
};
use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::interpolate::rows::{self, RowWork, nearest_depths};
use crate::interpolate::{Cover, HoleCount};
use crate::occlusion::{self, RowScratch};
use crate::propagate::{self, Frame, RectifiedView, RigCamera, Viewpoint};
use crate::sample::Dropped;
use crate::setting::FINITE;
use rayon::prelude::*;
use std::ops::Range;

/// A virtual view of a rectified rig.
pub struct Rows<'a> {
    views: &'a [RectifiedView<'a>],
    camera: RigCamera,
    view_weights: ViewWeights,
    frame: Frame,
    settings: RenderSettings,
}

impl Geometry for f64 {
    type Virtual<'a> = Rows<'a>;

    /// All views have the size of the first, which is also that of the virtual one.
    fn check(views: &[RectifiedView<'_>]) -> Result<(), RenderError> {
        let first = views.first().ok_or(RenderError::NoViews)?;
        let (width, height) = first.image.size();
        check_counts(views.len(), width * height)?;
        for (view, v) in views.iter().enumerate() {
            check_size(view, "the image", v.image.size(), first.image.size())?;
            check_size(view, "the disparity map", v.map.size(), first.image.size())?;
        }
        views.iter().try_for_each(|view| Ok(FINITE.check("position", view.camera)?))
    }

    fn virtual_view<'a>(
        renderer: &'a Renderer<'_, Self>,
        position: &Self,
        _: (usize, usize),
    ) -> Result<Rows<'a>, RenderError> {
        FINITE.check("position", *position)?;
        let (views, agreement, settings) = (renderer.views(), renderer.agreement(), renderer.settings());
        let mut view_weights = ViewWeights::of(views, position)
            .nearest(settings.nearest.unwrap_or(SHARING))
            .with_noise(agreement);
        let mut settings = settings.suited_to(agreement, &view_weights, Measure::Disparity);
        let used = view_weights.views().into_iter().map(|view| views[view].camera);
        let (test, size) = (&mut settings.interpolation.depth_test, views[0].image.size());
        *test =
            test.over(used.map(|camera| camera.displacement(position, size)).fold(f64::INFINITY, f64::min));
        if !settings.keep_exposure {
            view_weights = view_weights.with_gains(&agreement.gains);
        }
        let (width, height) = views[0].image.size();
        let frame = Frame::whole(width, height, rows::MARGIN, settings.offset);
        let camera = RigCamera { test: *settings.depth_test(), ..RigCamera::new(views, *position) };
        Ok(Rows { views, camera, view_weights, frame, settings })
    }
}

impl<const C: usize> Stages<C> for Rows<'_> {
    type Samples = Visible<C>;

    fn propagate(&self, rows: &Range<usize>) -> Visible<C> {
        let used = self.views.iter().enumerate().filter(|(index, _)| self.view_weights.uses(*index));
        let mut all = Visible::default();
        for (row, (index, view)) in rows.clone().flat_map(|row| used.clone().map(move |view| (row, view))) {
            let samples = &mut all.samples;
            all.dropped +=
                propagate::rectified_row(view, index as u16, row, &self.camera, &self.frame, samples);
        }
        Visible { propagated: all.samples.len(), ..all }
    }

    fn remove_hidden(&self, _: &Range<usize>, mut all: Visible<C>) -> Visible<C> {
        occlusion::remove_in_row(&mut all.samples, self.settings.depth_test(), &mut RowScratch::default());
        self.view_weights.apply(&mut all.samples);
        all
    }

    fn interpolate(
        &self,
        visible: impl Fn(Range<usize>) -> Visible<C> + Sync,
    ) -> Result<Rendering, RenderError> {
        let Frame { width, height, .. } = self.frame;
        let settings = &self.settings.interpolation;
        let (mut values, mut mask) =
            (vec![0.0; width * height * C], vec![Cover::Disocclusion; width * height]);
        let (mut keys, mut samples) = (vec![f32::NAN; width * height], vec![0_u16; width * height]);
        let mut counts = vec![RowCount::default(); height];
        let outputs = values
            .par_chunks_exact_mut(width * C)
            .zip(mask.par_chunks_exact_mut(width).zip(keys.par_chunks_exact_mut(width)))
            .zip(samples.par_chunks_exact_mut(width).zip(counts.par_iter_mut()));
        outputs.enumerate().try_for_each_init(
            || RowWork::<C>::new(width),
            |fit, (row, ((values, (mask, keys)), (samples, count)))| {
                let found = visible(row..row + 1);
                *count = RowCount::of(&found);
                rows::count(&found.samples, samples);
                nearest_depths(&found.samples, keys);
                let done = fit.interpolate(&found.samples, settings, values, mask);
                done.map(|_| ()).map_err(|source| RenderError::Fit { row, source })
            },
        )?;
        let report = self.report(&counts, &mask)?;
        let filled: Vec<bool> = counts.iter().map(|c| c.used > 0).collect();
        rows::finish::<C>(&filled, &mask, &keys, settings, &mut values);
        self.disparities(&mut keys);
        let image = Image::from_values((width, height), C, values);
        let depth = DepthMap::from_known((width, height), keys, Measure::Disparity);
        let (views, agreement) = (self.view_weights.views(), Agreement::default());
        Ok(Rendering { image, mask, depth, counts: samples, views, report, agreement })
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct RowCount {
    propagated: usize,
    used: usize,
    dropped: Dropped,
}

impl RowCount {
    fn of<const C: usize>(visible: &Visible<C>) -> Self {
        let Visible { samples, propagated, dropped } = visible;
        Self { propagated: *propagated, used: samples.len(), dropped: *dropped }
    }
}

impl Rows<'_> {
    fn disparities(&self, keys: &mut [f32]) {
        let offset = self.camera.disparity_offset;
        keys.iter_mut().for_each(|k| *k = (1.0 / f64::from(*k) - offset) as f32);
    }

    /// The report on all rows.
    ///
    /// # Errors
    /// [`RenderError::NoOverlap`].
    fn report(&self, counts: &[RowCount], mask: &[Cover]) -> Result<Report, RenderError> {
        let mut report = Report { holes: HoleCount::of(mask), ..Report::default() };
        for c in counts {
            report.propagated += c.propagated;
            report.used += c.used;
            report.dropped += c.dropped;
        }
        report.occluded = report.propagated - report.used;
        let (pixels, dropped) = (self.views.len() * self.frame.width * self.frame.height, report.dropped);
        if report.used > 0 { Ok(report) } else { Err(RenderError::NoOverlap { pixels, dropped }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn render(
        views: &[RectifiedView<'_>],
        position: f64,
        settings: &RenderSettings,
    ) -> Result<Rendering, RenderError> {
        Renderer::new(views, settings)?.render(&position, (0, 0))
    }

    fn scene(width: usize, height: usize, channels: usize) -> (Image, DepthMap) {
        let value = |i: usize| 120.0 + 80.0 * ((i / channels % width) as f32 * 0.4).sin() + (i % 7) as f32;
        let image =
            Image::new(width, height, channels, (0..width * height * channels).map(value).collect()).unwrap();
        let disparity = |i: usize| match i % width {
            x if x > width / 3 && x < width / 2 => 9.0,
            2 => 0.0,
            _ => 3.0 + (i / width) as f32 * 0.1,
        };
        let data = (0..width * height).map(disparity).collect();
        (image, DepthMap::new((width, height), data, 1.0, Measure::Disparity).unwrap())
    }

    fn views<'a>(parts: &'a [(Image, DepthMap)]) -> Vec<RectifiedView<'a>> {
        let view = |(i, (image, disparity)): (usize, &'a (Image, DepthMap))| RectifiedView {
            image,
            map: disparity,
            camera: i as f64,
        };
        parts.iter().enumerate().map(view).collect()
    }

    #[test]
    fn the_report_counts_every_pixel() {
        let parts = [scene(40, 9, 3), scene(40, 9, 3)];
        let report = render(&views(&parts), 0.4, &RenderSettings::default()).unwrap().report;
        assert_eq!(report.propagated + report.dropped.total(), 2 * 40 * 9);
        assert_eq!(report.propagated, report.occluded + report.used);
        assert!(report.occluded > 0 && report.dropped.unknown == 18 && report.holes.total() > 0);
    }

    #[test]
    fn the_number_of_threads_changes_no_bit() {
        let parts = [scene(64, 33, 3), scene(64, 33, 3)];
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render(&views(&parts), 0.3, &RenderSettings::default()).unwrap())
        };
        let one = run(1);
        assert_eq!(one, run(2));
        assert_eq!(one, run(5));
    }

    #[test]
    fn the_position_of_a_camera_gives_nearly_its_image() {
        let mut parts = [scene(48, 6, 1)];
        parts[0].1 = DepthMap::new((48, 6), vec![4.0; 288], 1.0, Measure::Disparity).unwrap();
        let mut settings = RenderSettings { keep_smoothing: true, ..RenderSettings::default() };
        settings.interpolation.fit.lambda = 0.0;
        settings.interpolation.fit.tau = 1e-9;
        let got = render(&views(&parts), 0.0, &settings).unwrap();
        let worst =
            got.image.data().iter().zip(parts[0].0.data()).fold(0.0, |w: f32, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-2, "{worst}");
        assert_eq!(got.coverage(), 1.0);
        assert!(got.depth.data().iter().all(|d| (d - 4.0).abs() < 1e-5));
    }

    /// Pixels have the disparity of the nearest visible sample, and none in holes.
    #[test]
    fn the_virtual_view_has_disparities() {
        let parts = [scene(48, 9, 1)];
        let got = render(&views(&parts), 0.0, &RenderSettings::default()).unwrap();
        for (p, d) in got.depth.data().iter().enumerate() {
            assert_eq!(d.is_nan(), got.mask[p] != Cover::Seen, "{p}");
            let own = parts[0].1.data()[p];
            assert!(d.is_nan() || own.is_nan() || (d - own).abs() < 1.0, "{p}: {d} {own}");
        }
    }

    #[test]
    fn wrong_input_is_named() {
        let (image, disparity) = scene(8, 8, 1);
        let small = Image::filled(7, 8, 1, 0.0);
        let view = |image, position| RectifiedView { image, map: &disparity, camera: position };
        let settings = RenderSettings::default();
        assert_eq!(render(&[], 0.0, &settings), Err(RenderError::NoViews));
        let sizes = render(&[view(&image, 0.0), view(&small, 1.0)], 0.5, &settings).unwrap_err();
        assert_eq!(sizes.to_string(), "view 1: the image has 7 x 8 pixels instead of 8 x 8");
        let nowhere = render(&[view(&image, f64::NAN)], 0.5, &settings).unwrap_err();
        assert_eq!(nowhere.to_string(), "position is NaN: it must be a finite number");
        let far = render(&[view(&image, 0.0)], 500.0, &settings).unwrap_err();
        assert!(matches!(far, RenderError::NoOverlap { pixels: 64, .. }), "{far}");
        let mut settings = settings;
        settings.interpolation.depth_test.relative = 0.0;
        let none = render(&[view(&image, 0.0)], 0.5, &settings).unwrap_err().to_string();
        assert_eq!(
            none,
            "sum of relative and absolute depth difference is 0: it must be a positive finite number"
        );
    }
}
