//! How long a view takes: rows and plane, two sizes, mean shift, uncalibrated geometry.
//!
//! The views are those of the synthetic scene, so that the inputs repeat exactly.

#[path = "../../benches/stopwatch/mod.rs"]
mod stopwatch;

use hybank_ibr::camera::Camera;
use hybank_ibr::depth::DepthMap;
use hybank_ibr::image::Image;
use hybank_ibr::pipeline::{Method, RenderSettings, calibrated, rectified};
use hybank_ibr::propagate::{CalibratedView, RectifiedView};
use hybank_ibr::segment::MeanShift;
use hybank_ibr::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use stopwatch::time;

struct View {
    image: Image,
    depth: DepthMap,
    disparity: DepthMap,
    camera: Camera,
    position: f64,
}

fn views(size: (usize, usize)) -> Vec<View> {
    let view = |position: f64| {
        let camera = Camera::metric(rig_camera(position, size), false).expect("a rig camera is regular");
        let (image, depth) = SyntheticScene::default().view(&camera, size);
        let disparity = rig_disparity(&depth, size.0);
        View { image, depth, disparity, camera, position }
    };
    [0.0, 1.0].map(view).into()
}

fn two_views_full_depth(size: (usize, usize)) {
    let views = views(size);
    let rows: Vec<RectifiedView<'_>> = views
        .iter()
        .map(|v| RectifiedView { image: &v.image, disparity: &v.disparity, position: v.position })
        .collect();
    let settings = RenderSettings { method: Method::Rows, ..RenderSettings::default() };
    time(&format!("two views, full depth, rows {}x{}", size.0, size.1), || {
        rectified::render(&rows, 0.5, &settings).expect("the views overlap")
    });
    let free: Vec<CalibratedView<'_>> =
        views.iter().map(|v| CalibratedView { image: &v.image, depth: &v.depth, camera: v.camera }).collect();
    let target = Camera::metric(rig_camera(0.5, size), false).expect("a rig camera is regular");
    let settings = RenderSettings::default();
    time(&format!("two views, full depth, plane {}x{}", size.0, size.1), || {
        calibrated::render(&free, &target, size, &settings).expect("they overlap")
    });
}

fn main() {
    [(450, 375), (1920, 1080)].into_iter().for_each(two_views_full_depth);
    let image = &views((450, 375))[0].image;
    time("mean shift, 450x375", || MeanShift::default().segment(image).expect("default settings"));
}
