//! The rows of a rendering allocate nothing once their work memory has grown to the longest row.

use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use hybank_ibr::camera::Camera;
use hybank_ibr::interpolate::rows::{self, RowWork};
use hybank_ibr::interpolate::{Cover, Settings};
use hybank_ibr::occlusion::{RowScratch, remove_in_row};
use hybank_ibr::propagate::{Frame, RectifiedView, RigCamera, rectified_row};
use hybank_ibr::sample::Sample;

const SIZE: (usize, usize) = (160, 40);

#[test]
fn rows_allocate_nothing() {
    let record = |position: f64| {
        let camera = Camera::metric(rig_camera(position, SIZE), false).unwrap();
        let (image, depth) = SyntheticScene::default().view(&camera, SIZE);
        (image, rig_disparity(&depth, SIZE.0), position)
    };
    let sources = [0.0, 1.0].map(record);
    let views = sources.each_ref().map(|(image, disparity, position)| RectifiedView {
        image,
        map: disparity,
        camera: *position,
    });
    let (settings, camera) = (Settings::default(), RigCamera::new(&views, 0.5));
    let frame = Frame::whole(SIZE.0, SIZE.1, rows::MARGIN, 0.0);
    let mut samples: Vec<Sample<3>> = Vec::with_capacity(2 * SIZE.0);
    let (mut scratch, mut work) = (RowScratch::default(), RowWork::<3>::new(SIZE.0));
    let (mut values, mut mask) = (vec![0.0; 3 * SIZE.0], vec![Cover::Seen; SIZE.0]);
    let mut removed = 0;
    let mut render = |y: usize| {
        samples.clear();
        for (index, view) in views.iter().enumerate() {
            rectified_row(view, index as u16, y, &camera, &frame, &mut samples);
        }
        removed += remove_in_row(&mut samples, &settings.depth_test, &mut scratch);
        work.interpolate(&samples, &settings, &mut values, &mut mask).unwrap();
    };
    // The first pass finds the longest row.
    (0..SIZE.1).for_each(&mut render);
    let measured = allocation_counter::measure(|| (0..SIZE.1).for_each(&mut render));
    assert_eq!(measured.count_total, 0, "{measured:?}");
    assert!(removed > 0, "no row had anything to remove");
    assert!(
        allocation_counter::measure(|| drop(std::hint::black_box(vec![0_u8; 100]))).count_total > 0,
        "the counter counts"
    );
}
