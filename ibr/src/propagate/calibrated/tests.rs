//! The footprint against the propagation of every pixel.

use super::*;
use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::occlusion::PlaneSearch;
use crate::sample::Sample;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, Vector3};

const SIZE: (usize, usize) = (150, 90);

fn camera(position: [f64; 3], roll: f64) -> Camera {
    let k = Matrix3::new(120.0, 0.0, 74.5, 0.0, 120.0, 44.5, 0.0, 0.0, 1.0);
    let r = Rotation3::from_euler_angles(0.02, -0.03, roll);
    let mut rt = Matrix3x4::zeros();
    rt.fixed_columns_mut::<3>(0).copy_from(r.matrix());
    rt.set_column(3, &(-(r * Vector3::from(position))));
    Camera::metric(k * rt, false).unwrap()
}

fn scene() -> (Image, DepthMap) {
    let image =
        Image::new(SIZE.0, SIZE.1, 1, (0..SIZE.0 * SIZE.1).map(|i| (i % 251) as f32).collect()).unwrap();
    let depth = |i: usize| match (i % SIZE.0, i / SIZE.0) {
        (40..70, 20..60) => 3.0,
        (x, y) if (x + y) % 97 == 0 => f32::NAN,
        (x, y) => 6.0 + 0.01 * x as f32 + 0.004 * y as f32,
    };
    let data = (0..SIZE.0 * SIZE.1).map(depth).collect();
    (image, DepthMap::new(SIZE, data, 1.0, Measure::Depth).unwrap())
}

impl Footprint {
    /// The samples between two rows of the frame, both included: view by view and row by row.
    fn samples_between<const C: usize>(
        &self,
        views: &[CalibratedView<'_>],
        top: f64,
        bottom: f64,
    ) -> Vec<Sample<C>> {
        let (mut projected, band) = (Projected::default(), self.frame.band(top, bottom));
        for tile in self.reaching(band.rows, |_| 0.0) {
            let view = usize::from(tile.view);
            projected.push(
                &views[view],
                &self.maps[view],
                tile,
                &band,
                (f64::MIN, f64::MAX),
                &DepthTest::default(),
            );
        }
        projected.samples(views)
    }
}

/// All samples of views, view by view and row by row.
pub(crate) fn calibrated<const C: usize>(
    views: &[CalibratedView<'_>],
    camera: &Camera,
    frame: &Frame,
) -> (Vec<Sample<C>>, Dropped) {
    let all: Vec<usize> = (0..views.len()).collect();
    let footprint = Footprint::of(views, &all, camera, frame);
    let samples = footprint.samples_between(views, f64::MIN, f64::MAX);
    let dropped = footprint.dropped(samples.len());
    (samples, dropped)
}

#[test]
fn bands_together_are_the_whole() {
    let (image, depth) = scene();
    let views = [camera([0.2, 0.0, 0.0], 0.05), camera([-0.3, 0.1, -0.2], -0.3)]
        .map(|camera| CalibratedView { image: &image, map: &depth, camera });
    let target = camera([0.0, 0.0, 0.4], 0.0);
    let frame = Frame::whole(SIZE.0, SIZE.1, 0.5, 0.0);
    let (all, dropped) = calibrated::<1>(&views, &target, &frame);
    let footprint = Footprint::of(&views, &[0, 1], &target, &frame);
    assert_eq!(footprint.dropped(all.len()), dropped);
    assert!(footprint.most_samples() >= all.len());
    assert_eq!(all.len() + dropped.total(), 2 * SIZE.0 * SIZE.1);
    for (top, bottom) in [(-1.0, 12.25), (12.25, 60.0), (88.0, 200.0), (40.0, 40.0)] {
        let band = footprint.samples_between::<1>(&views, top, bottom);
        let want: Vec<_> = all.iter().filter(|s| s.y >= top && s.y <= bottom).copied().collect();
        assert_eq!(band, want, "{top} {bottom}");
    }
}

/// No sample of a tile has a larger spacing than its bound says. Within a surface the bound is near, at
/// depth edges it is not.
#[test]
fn the_spacing_of_a_tile_is_bounded() {
    let (image, depth) = scene();
    let target = camera([0.0, 0.1, 0.9], 0.2);
    let views = [camera([0.2, 0.0, 0.0], 0.05), camera([-0.3, 0.1, -0.2], -0.3), target]
        .map(|camera| CalibratedView { image: &image, map: &depth, camera });
    let frame = Frame::whole(SIZE.0, SIZE.1, 20.0, 0.0);
    let footprint = Footprint::of(&views, &[0, 1, 2], &target, &frame);
    let (mut found, mut near) = (0, 0);
    for tile in &footprint.tiles {
        let mut projected = Projected::default();
        let view = usize::from(tile.view);
        projected.push(
            &views[view],
            &footprint.maps[view],
            tile,
            &frame,
            (f64::MIN, f64::MAX),
            &DepthTest::default(),
        );
        for s in projected.samples::<1>(&views) {
            assert!(s.spacing <= tile.spacing, "{s:?} in {tile:?}");
            near += usize::from(tile.spacing < 2.0 * s.spacing);
            found += 1;
        }
    }
    assert!(found > 20_000 && near > found / 2, "{near} of {found}");
}

/// Bands find the hidden samples of the whole image, also where their spacing is far above a pixel.
#[test]
fn bands_hide_what_the_whole_hides() {
    let (image, depth) = scene();
    let views = [camera([0.2, 0.0, 0.0], 0.05), camera([-0.3, 0.1, -0.2], -0.3)]
        .map(|camera| CalibratedView { image: &image, map: &depth, camera });
    for (forward, epsilon) in [(0.0, 0.7), (1.6, 0.7), (0.5, 3.0)] {
        let target = camera([0.0, 0.0, forward], 0.0);
        let frame = Frame::whole(SIZE.0, SIZE.1, 0.5, 0.0);
        let test = DepthTest { epsilon, ..DepthTest::default() };
        let (mut want, _) = calibrated::<1>(&views, &target, &frame);
        assert!(crate::occlusion::remove(&mut want, &test) > 100);
        let footprint = Footprint::of(&views, &[0, 1], &target, &frame);
        let (mut search, mut got) = (PlaneSearch::default(), Vec::new());
        for own in [(f64::MIN, 1.0), (1.0, 23.5), (23.5, 24.0), (24.0, 70.0), (70.0, f64::MAX)] {
            let mut projected = footprint.project_between(&views, own, &test);
            projected.remove(search.hidden(projected.points(), &test));
            got.extend(projected.samples::<1>(&views));
        }
        let order = |s: &Sample<1>| (s.view, s.pixel);
        got.sort_by_key(order);
        assert_eq!(got, want, "{forward}");
    }
}

/// Eight bands look at hardly more pixels than one: the cost does not grow with the number of bands.
#[test]
fn every_pixel_is_looked_at_about_once() {
    let (image, depth) = scene();
    let views = [camera([0.2, 0.0, 0.0], 0.0), camera([-0.2, 0.0, 0.0], 0.0)].map(|camera| CalibratedView {
        image: &image,
        map: &depth,
        camera,
    });
    let frame = Frame::whole(SIZE.0, SIZE.1, 0.5, 0.0);
    let footprint = Footprint::of(&views, &[0, 1], &camera([0.0, 0.0, 0.0], 0.0), &frame);
    let looked_at: usize = (0..8)
        .map(|k| frame.band(k as f64 * 11.25, (k + 1) as f64 * 11.25))
        .map(|band| footprint.reaching(band.rows, |_| 0.0).count())
        .sum();
    assert!(
        looked_at as f64 <= 1.3 * footprint.tiles.len() as f64,
        "{looked_at} of {}",
        footprint.tiles.len()
    );
}

/// Distances and areas against those of the neighbouring samples.
#[test]
fn spacing_and_weight_follow_the_neighbours() {
    let plane = |i: usize| 1.0 / (0.2 + 0.001 * (i % SIZE.0) as f32 - 0.0005 * (i / SIZE.0) as f32);
    let data = (0..SIZE.0 * SIZE.1).map(plane).collect();
    let depth = DepthMap::new(SIZE, data, 1.0, Measure::Depth).unwrap();
    let (image, _) = scene();
    let view = CalibratedView { image: &image, map: &depth, camera: camera([0.1, 0.0, 0.0], 0.1) };
    let frame = Frame::whole(1000, 1000, 1000.0, 0.0);
    let (samples, _) = calibrated::<1>(&[view], &camera([0.0, 0.0, 1.9], 0.0), &frame);
    assert_eq!(samples.len(), SIZE.0 * SIZE.1);
    for (x, y) in (1..SIZE.0 - 1).step_by(7).flat_map(|x| (1..SIZE.1 - 1).step_by(5).map(move |y| (x, y))) {
        let at = |x: usize, y: usize| &samples[y * SIZE.0 + x];
        let difference = |a: &Sample<1>, b: &Sample<1>| [(a.x - b.x) / 2.0, (a.y - b.y) / 2.0];
        let (p, q) = (difference(at(x + 1, y), at(x - 1, y)), difference(at(x, y + 1), at(x, y - 1)));
        let mean = (p[0] * p[0] + p[1] * p[1] + q[0] * q[0] + q[1] * q[1]) / 2.0;
        let area = (p[0] * q[1] - p[1] * q[0]).abs();
        let s = at(x, y);
        assert!(
            (f64::from(s.spacing) / mean.sqrt() - 1.0).abs() < 0.02,
            "{x} {y}: {} {}",
            s.spacing,
            mean.sqrt()
        );
        assert!((f64::from(s.weight) / area.max(1.0) - 1.0).abs() < 0.03, "{x} {y}: {} {area}", s.weight);
    }
}
