//! A view from any number of calibrated cameras with depth.

use super::depth_errors::median;
use super::nearness::{Nearness, Placed, choose};
use super::shares::Shares;
use super::{
    Agreement, RenderError, RenderSettings, Rendering, Report, ViewWeights, check_counts, check_size,
};
use crate::camera::Camera;
use crate::depth::Measure;
use crate::interpolate::Degree;
use crate::interpolate::plane::PlaneProblem;
use crate::occlusion::{DepthTest, PlaneSearch};
use crate::propagate::{CalibratedView, Footprint, Frame};
use crate::sample::Sample;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Shares of the depths of a map that are nearer than those for which views are chosen.
pub(crate) const QUARTILES: [f64; 2] = [0.25, 0.75];
/// Samples held in memory at a time; larger scenes are rendered in bands of rows.
const SAMPLES_AT_A_TIME: usize = 1 << 16;
/// Fewest rows of a band, however many samples they have: neighbouring bands share some rows, whose samples
/// are made twice.
const FEWEST_ROWS: usize = 40;

/// Renders the view of `camera` with `width` x `height` pixels.
///
/// # Errors
/// [`RenderError`], naming view, sizes and numbers.
pub fn render(
    views: &[CalibratedView<'_>],
    camera: &Camera,
    size: (usize, usize),
    settings: &RenderSettings,
) -> Result<Rendering, RenderError> {
    check(views, size, settings)?;
    let colour = views.iter().any(|v| v.image.channels() == 3);
    match (settings.interpolation.plane.degree, colour) {
        (Degree::Linear, false) => render_with::<2, 1>(views, camera, size, settings),
        (Degree::Linear, true) => render_with::<2, 3>(views, camera, size, settings),
        (Degree::Cubic, false) => render_with::<4, 1>(views, camera, size, settings),
        (Degree::Cubic, true) => render_with::<4, 3>(views, camera, size, settings),
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

fn check(
    views: &[CalibratedView<'_>],
    size: (usize, usize),
    settings: &RenderSettings,
) -> Result<(), RenderError> {
    let largest = views.iter().map(|v| v.image.width() * v.image.height()).max().unwrap_or(0);
    check_counts(views.len(), largest.max(size.0.saturating_mul(size.1)))?;
    settings.check()?;
    let mut all = views.iter().enumerate();
    all.try_for_each(|(view, v)| check_size(view, "the depth map", v.map.size(), v.image.size()))
}

/// Bands of rows for views of so many pixels in all.
fn bands_of(pixels: usize, height: usize) -> usize {
    pixels.div_ceil(SAMPLES_AT_A_TIME).min(height.div_ceil(FEWEST_ROWS)).max(1)
}

fn render_with<const ORDER: usize, const C: usize>(
    views: &[CalibratedView<'_>],
    camera: &Camera,
    (width, height): (usize, usize),
    settings: &RenderSettings,
) -> Result<Rendering, RenderError> {
    let chosen = chosen(views, &Placed { camera: *camera, size: (width, height) }, settings);
    let agreement = Agreement::of(views);
    let view_weights = ViewWeights::of(views, camera).only(&chosen).with_noise(&agreement);
    let settings = &settings.suited_to(&agreement, &view_weights, Measure::Depth);
    let pixels: usize = chosen.iter().map(|v| views[*v].image.width() * views[*v].image.height()).sum();
    let mut problem = PlaneProblem::<ORDER, C>::new((width, height), &settings.interpolation);
    let footprint = Footprint::of(views, &chosen, camera, &Frame::whole(width, height, 0.5, settings.offset));
    let view_weights =
        if settings.keep_exposure { view_weights } else { view_weights.with_gains(&agreement.gains) };
    let nearness = Nearness::new(views.iter().map(|view| view.camera), camera);
    let (offset, sharing) = (settings.offset, Shares::sharing(settings.nearest));
    let shares = Shares { nearness, camera, offset, width, sharing, view_weights: &view_weights };
    let count = bands_of(footprint.most_samples(), height);
    let bands: Vec<Range<usize>> =
        (0..count).map(|band| band * height / count..(band + 1) * height / count).collect();
    let propagated = AtomicUsize::new(0);
    problem.add_bands(&bands, |rows| {
        let (samples, all) = visible_in(rows, height, &footprint, views, settings.depth_test(), &shares);
        propagated.fetch_add(all, Ordering::Relaxed);
        samples
    });
    let propagated = propagated.into_inner();
    let (used, dropped) = (problem.samples(), footprint.dropped(propagated));
    drop(footprint);
    if propagated == 0 {
        return Err(RenderError::NoOverlap { pixels, dropped });
    }
    let report = Report { propagated, occluded: propagated - used, used, dropped, ..Report::default() };
    let fit = problem.stiffened_by_area().solve();
    Ok(Rendering::of_plane::<C>(fit, report, chosen, agreement))
}

/// The first two stages for some rows of the virtual image: the visible samples of these rows, and the
/// number of all of their samples. The band is widened by the largest radius of the depth test on both
/// sides, so that it contains every sample that can hide one of the band.
fn visible_in<const C: usize>(
    rows: &Range<usize>,
    height: usize,
    footprint: &Footprint,
    views: &[CalibratedView<'_>],
    test: &DepthTest,
    shares: &Shares<'_>,
) -> (Vec<Sample<C>>, usize) {
    let last = rows.end == height;
    let top = if rows.start == 0 { f64::MIN } else { rows.start as f64 };
    let bottom = if last { f64::MAX } else { rows.end as f64 };
    let mut projected = footprint.project_between(views, (top, bottom), test);
    let all = projected.count();
    projected.share(shares.of_points());
    projected.remove(PlaneSearch::default().hidden(projected.points(), test));
    let mut samples = projected.samples(views);
    shares.apply(&mut samples, projected.shares());
    (samples, all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::{DepthMap, Measure};
    use crate::image::Image;
    use crate::occlusion;
    use crate::propagate;
    use nalgebra::Matrix3x4;

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
        let view_weights = ViewWeights::of(&views, &target);
        let shares = Shares {
            nearness: Nearness::new(views.iter().map(|view| view.camera), &target),
            camera: &target,
            offset: 0.0,
            width: 40,
            sharing: 4,
            view_weights: &view_weights,
        };
        let mut of_point = shares.of_points();
        let all = samples.iter().map(|s| of_point(s.view, [s.x, s.y], s.depth)).collect();
        shares.apply(&mut samples, all);
        let mut problem = PlaneProblem::<4, 1>::new((40, 30), &settings.interpolation);
        problem.add(&samples);
        let fit = problem.stiffened_by_area().solve();
        assert_eq!((got.image.data(), &got.mask), (&fit.values[..], &fit.mask));
        // In bands only the order of summation differs.
        let footprint = Footprint::of(&views, &(0..views.len()).collect::<Vec<_>>(), &target, &frame);
        let mut problem = PlaneProblem::<4, 1>::new((40, 30), &settings.interpolation);
        for rows in [0..7, 7..8, 8..30] {
            let (band, _) = visible_in(&rows, 30, &footprint, &views, settings.depth_test(), &shares);
            problem.add(&band);
        }
        assert_eq!(problem.samples(), samples.len());
        let banded = problem.stiffened_by_area().solve();
        assert_eq!(banded.mask, fit.mask);
        let worst = banded.values.iter().zip(&fit.values).fold(0.0, |w: f32, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-2, "{worst}");
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
