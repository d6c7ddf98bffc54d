//! Virtual views of any number of calibrated cameras with depth. The first two stages run in bands of rows,
//! and the third on the whole plane.

use super::depth_errors::median;
use super::nearness::{Nearness, Placed, choose};
use super::shares::Shares;
use super::{
    Agreement, Geometry, RenderError, RenderSettings, Renderer, Rendering, Report, Stages, ViewWeights,
    Visible, check_counts, check_size,
};
use crate::camera::Camera;
use crate::depth::Measure;
use crate::interpolate::Degree;
use crate::interpolate::plane::PlaneProblem;
use crate::occlusion::PlaneSearch;
use crate::propagate::{CalibratedView, Footprint, Frame, Projected, Viewpoint};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Shares of the depths of a map that are nearer than those for which views are chosen.
pub(crate) const QUARTILES: [f64; 2] = [0.25, 0.75];
/// Samples held in memory at a time; larger scenes are rendered in bands of rows.
const SAMPLES_AT_A_TIME: usize = 1 << 16;
/// Fewest rows of a band, however many samples they have: neighbouring bands share some rows, whose samples
/// are made twice.
const FEWEST_ROWS: usize = 40;

/// A virtual view of general cameras.
pub struct Plane<'a> {
    views: &'a [CalibratedView<'a>],
    chosen: Vec<usize>,
    footprint: Footprint,
    shares: Shares,
    size: (usize, usize),
    settings: RenderSettings,
}

impl Geometry for Camera {
    type Virtual<'a> = Plane<'a>;

    fn check(views: &[CalibratedView<'_>]) -> Result<(), RenderError> {
        let largest = views.iter().map(|v| v.image.width() * v.image.height()).max().unwrap_or(0);
        check_counts(views.len(), largest)?;
        let mut all = views.iter().enumerate();
        all.try_for_each(|(view, v)| check_size(view, "the depth map", v.map.size(), v.image.size()))
    }

    fn virtual_view<'a>(
        renderer: &'a Renderer<'_, Self>,
        camera: &Self,
        size: (usize, usize),
    ) -> Result<Plane<'a>, RenderError> {
        let (views, agreement, settings) = (renderer.views(), renderer.agreement(), renderer.settings());
        check_counts(views.len(), size.0.saturating_mul(size.1))?;
        let chosen = chosen(views, &Placed { camera: *camera, size }, settings);
        let view_weights = ViewWeights::of(views, camera).only(&chosen).with_noise(agreement);
        let mut settings = settings.suited_to(agreement, &view_weights, Measure::Depth);
        let displacement = |view: &usize| views[*view].camera.displacement(camera, views[*view].image.size());
        let test = &mut settings.interpolation.depth_test;
        *test = test.over(chosen.iter().map(displacement).fold(f64::INFINITY, f64::min));
        let frame = Frame::whole(size.0, size.1, 0.5, settings.offset);
        let footprint = Footprint::of(views, &chosen, camera, &frame);
        let shares = Shares {
            nearness: Nearness::new(views.iter().map(|view| view.camera), camera),
            camera: *camera,
            offset: settings.offset,
            width: size.0,
            sharing: Shares::sharing(settings.nearest),
            view_weights: match settings.keep_exposure {
                true => view_weights,
                false => view_weights.with_gains(&agreement.gains),
            },
        };
        Ok(Plane { views, chosen, footprint, shares, size, settings })
    }
}

/// The views that a virtual view is made of, by number.
fn chosen(views: &[CalibratedView<'_>], target: &Placed, settings: &RenderSettings) -> Vec<usize> {
    let placed = |view: &CalibratedView<'_>| Placed { camera: view.camera, size: view.image.size() };
    let depths = |share: f64| {
        let mut depths: Vec<f64> =
            views.iter().filter_map(|view| view.map.quantile(share)).map(f64::from).collect();
        median(&mut depths)
    };
    let depths: Vec<f64> = QUARTILES.into_iter().filter_map(depths).collect();
    choose(&views.iter().map(placed).collect::<Vec<_>>(), target, &depths, settings.nearest)
}

/// Bands of rows for views of so many pixels in all.
fn bands_of(pixels: usize, height: usize) -> usize {
    pixels.div_ceil(SAMPLES_AT_A_TIME).min(height.div_ceil(FEWEST_ROWS)).max(1)
}

impl<const C: usize> Stages<C> for Plane<'_> {
    type Samples = Projected;

    /// The band is widened by the largest radius of the depth test on both sides, so that it contains every
    /// sample that can hide one of the band.
    fn propagate(&self, rows: &Range<usize>) -> Projected {
        let top = if rows.start == 0 { f64::MIN } else { rows.start as f64 };
        let bottom = if rows.end == self.size.1 { f64::MAX } else { rows.end as f64 };
        self.footprint.project_between(self.views, (top, bottom), self.settings.depth_test())
    }

    fn remove_hidden(&self, _: &Range<usize>, mut projected: Projected) -> Visible<C> {
        let propagated = projected.count();
        projected.share(|view, points, range, shares| self.shares.of_points(view, points, range, shares));
        projected.remove(PlaneSearch::default().hidden(projected.points(), self.settings.depth_test()));
        let mut samples = projected.samples(self.views);
        self.shares.apply(&mut samples, projected.shares());
        Visible { samples, propagated, ..Visible::default() }
    }

    fn interpolate(
        &self,
        visible: impl Fn(Range<usize>) -> Visible<C> + Sync,
    ) -> Result<Rendering, RenderError> {
        match self.settings.interpolation.plane.degree {
            Degree::Linear => self.fit::<2, C>(visible),
            Degree::Cubic => self.fit::<4, C>(visible),
        }
    }
}

impl Plane<'_> {
    fn fit<const ORDER: usize, const C: usize>(
        &self,
        visible: impl Fn(Range<usize>) -> Visible<C> + Sync,
    ) -> Result<Rendering, RenderError> {
        let (height, count) = (self.size.1, bands_of(self.footprint.most_samples(), self.size.1));
        let bands: Vec<Range<usize>> =
            (0..count).map(|band| band * height / count..(band + 1) * height / count).collect();
        let mut problem = PlaneProblem::<ORDER, C>::new(self.size, &self.settings.interpolation);
        let propagated = AtomicUsize::new(0);
        problem.add_bands(&bands, |rows| {
            let found = visible(rows.clone());
            propagated.fetch_add(found.propagated, Ordering::Relaxed);
            found.samples
        });
        let (propagated, used) = (propagated.into_inner(), problem.samples());
        let dropped = self.footprint.dropped(propagated);
        if propagated == 0 {
            return Err(RenderError::NoOverlap { pixels: self.footprint.pixels, dropped });
        }
        let report = Report { propagated, occluded: propagated - used, used, dropped, ..Report::default() };
        let fit = problem.stiffened_by_area().solve();
        Ok(Rendering::of_plane::<C>(fit, report, self.chosen.clone(), Agreement::default()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::{DepthMap, Measure};
    use crate::image::Image;
    use crate::occlusion::{self, Points};
    use crate::propagate::{self, View};
    use nalgebra::Matrix3x4;

    fn render(
        views: &[CalibratedView<'_>],
        camera: &Camera,
        size: (usize, usize),
        settings: &RenderSettings,
    ) -> Result<Rendering, RenderError> {
        Renderer::new(views, settings)?.render(camera, size)
    }

    fn camera(x: f64, turn: f64) -> Camera {
        let r = nalgebra::Rotation3::from_euler_angles(0.0, turn, 0.02);
        let k = nalgebra::Matrix3::new(40.0, 0.0, 19.5, 0.0, 40.0, 14.5, 0.0, 0.0, 1.0);
        let mut rt = Matrix3x4::zeros();
        rt.fixed_columns_mut::<3>(0).copy_from(r.matrix());
        rt.set_column(3, &(-(r * nalgebra::Vector3::new(x, 0.1 * x, 0.0))));
        Camera::metric(k * rt, false).unwrap()
    }

    fn scene() -> (Image, DepthMap) {
        let image = Image::new(40, 30, 1, (0..1200).map(|i| ((i * 7) % 256) as f32).collect()).unwrap();
        let depth = (0..1200).map(|i| if i % 40 > 25 { 3.0 } else { 5.0 + (i / 40) as f32 * 0.05 }).collect();
        (image, DepthMap::new((40, 30), depth, 1.0, Measure::Depth).unwrap())
    }

    /// A roof of 4 m that drones at 100 m see, 16 pixels of parallax apart. With 5 % of the depth alone the
    /// ground behind it shone through.
    #[test]
    fn a_roof_hides_the_ground() {
        let size = (60, 45);
        let camera = |x: f64| {
            let k = nalgebra::Matrix3::new(400.0, 0.0, 29.5 + 4.0 * x, 0.0, 400.0, 22.0, 0.0, 0.0, 1.0);
            let mut rt = Matrix3x4::identity();
            rt[(0, 3)] = -x;
            Camera::metric(k * rt, false).unwrap()
        };
        let is_roof = |column: usize, x: f64| (column as f64 - 29.5 + x / 6.0).abs() <= 12.5;
        let shot = |x: f64| {
            let of = |roof: f32, ground: f32| -> Vec<f32> {
                (0..size.0 * size.1).map(|p| if is_roof(p % size.0, x) { roof } else { ground }).collect()
            };
            let map = DepthMap::new(size, of(96.0, 100.0), 1.0, Measure::Depth).unwrap();
            (Image::new(size.0, size.1, 1, of(200.0, 60.0)).unwrap(), map)
        };
        let shots = [-50.0, 50.0].map(|x| (shot(x), camera(x)));
        let views = shots.each_ref().map(|((image, map), camera)| View { image, map, camera: *camera });
        let done = render(&views, &camera(0.0), size, &RenderSettings::default()).unwrap();
        let roof = (18..42).map(|column| done.image.row(20)[column]);
        assert!(done.report.occluded > 400 && roof.fold(255.0, f32::min) > 195.0, "{:?}", done.report);
    }

    #[test]
    fn equal_to_the_three_stages_also_in_bands() {
        let (image, depth) = scene();
        let view = |c| CalibratedView { image: &image, map: &depth, camera: c };
        let views = [view(camera(-0.3, 0.03)), view(camera(0.4, -0.04))];
        let target = camera(0.05, 0.0);
        let settings = RenderSettings::default();
        let got = render(&views, &target, (40, 30), &settings).unwrap();
        let frame = Frame::whole(40, 30, 0.5, 0.0);
        let (mut samples, dropped) = propagate::calibrated::<1>(&views, &target, &frame);
        assert_eq!((got.report.propagated, got.report.dropped), (samples.len(), dropped));
        assert_eq!(got.report.occluded, occlusion::remove(&mut samples, settings.depth_test()));
        assert!(got.report.occluded > 0);
        let renderer = Renderer::new(&views, &settings).unwrap();
        let plane = Camera::virtual_view(&renderer, &target, (40, 30)).unwrap();
        let points = Points::of(samples.iter().copied());
        let mut all = vec![0.0; samples.len()];
        for (i, (s, share)) in samples.iter().zip(all.chunks_mut(1)).enumerate() {
            plane.shares.of_points(s.view, &points, i..i + 1, share);
        }
        plane.shares.apply(&mut samples, all);
        let mut problem = PlaneProblem::<4, 1>::new((40, 30), &settings.interpolation);
        problem.add(&samples);
        let fit = problem.stiffened_by_area().solve();
        assert_eq!((got.image.data(), &got.mask), (&fit.values[..], &fit.mask));
        // In bands only the order of summation differs.
        let mut problem = PlaneProblem::<4, 1>::new((40, 30), &settings.interpolation);
        for rows in [0..7, 7..8, 8..30] {
            let projected = Stages::<1>::propagate(&plane, &rows);
            problem.add(&Stages::<1>::remove_hidden(&plane, &rows, projected).samples);
        }
        assert_eq!(problem.samples(), samples.len());
        let banded = problem.stiffened_by_area().solve();
        assert_eq!(banded.mask, fit.mask);
        let worst = banded.values.iter().zip(&fit.values).fold(0.0, |w: f32, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-2, "{worst}");
    }

    /// A frame of a film has the bits of a picture, whatever was rendered before.
    #[test]
    fn renderings_are_repeatable() {
        let (image, depth) = scene();
        let view = |c| CalibratedView { image: &image, map: &depth, camera: c };
        let views = [view(camera(-0.3, 0.03)), view(camera(0.4, -0.04))];
        let film = Renderer::new(&views, &RenderSettings::default()).unwrap();
        let frames = [0.05, 0.2, 0.05].map(|x| film.render(&camera(x, 0.0), (40, 30)).unwrap());
        assert!(frames[0] == frames[2] && frames[0] != frames[1]);
        let alone = render(&views, &camera(0.2, 0.0), (40, 30), &RenderSettings::default()).unwrap();
        assert!(alone == frames[1]);
    }

    /// Where all depths are guesses the texture keeps most of the contrast that it has where they are known.
    #[test]
    fn texture_on_guessed_depth_keeps_its_contrast() {
        let texture = |i: usize| 120.0 + 60.0 * ((i % 40) as f32 * 1.3).sin() * ((i / 40) as f32 * 1.1).cos();
        let image = Image::new(40, 30, 1, (0..1200).map(texture).collect()).unwrap();
        let is_hole = |p: usize| (10..30).contains(&(p % 40)) && (8..24).contains(&(p / 40));
        let known = DepthMap::new((40, 30), vec![5.0; 1200], 1.0, Measure::Depth).unwrap();
        let holes = (0..1200).map(|p| if is_hole(p) { f32::NAN } else { 5.0 }).collect();
        let mut guessed = DepthMap::new((40, 30), holes, 1.0, Measure::Depth).unwrap();
        crate::depth::fill_unknown(&mut guessed);
        let contrast = |map: &DepthMap| {
            let views = [CalibratedView { image: &image, map, camera: camera(0.0, 0.0) }];
            let got = render(&views, &camera(0.04, 0.0), (40, 30), &RenderSettings::default()).unwrap().image;
            let inner = (0..1200).filter(|p| (13..27).contains(&(p % 40)) && (11..21).contains(&(p / 40)));
            inner.map(|p| f64::from(got.data()[p] - 120.0).powi(2)).sum::<f64>().sqrt()
        };
        assert!(contrast(&guessed) > 0.75 * contrast(&known), "{} {}", contrast(&guessed), contrast(&known));
    }

    #[test]
    fn views_that_see_nothing_are_an_error() {
        let (image, depth) = scene();
        let view = CalibratedView { image: &image, map: &depth, camera: camera(0.0, 0.0) };
        let away = camera(0.0, std::f64::consts::PI);
        let error = render(&[view], &away, (40, 30), &RenderSettings::default()).unwrap_err();
        assert!(matches!(error, RenderError::NoOverlap { dropped, .. } if dropped.behind == 1200), "{error}");
        let other = DepthMap::new((4, 3), vec![1.0; 12], 1.0, Measure::Depth).unwrap();
        let view = CalibratedView { map: &other, ..view };
        let error = render(&[view], &away, (40, 30), &RenderSettings::default()).unwrap_err();
        assert!(error.to_string().contains("the depth map has 4 x 3"), "{error}");
    }
}
