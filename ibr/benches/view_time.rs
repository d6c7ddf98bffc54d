//! How long a view takes: rows and plane, two sizes, two views and eight, coarse depth.
//!
//! The views are those of the synthetic scene, so that the inputs repeat exactly. Only renderings are timed:
//! the photographs and their depths are in memory. An argument chooses the lines that contain it
//! (`cargo bench -p hybank-ibr --bench view_time -- "2 views, full depth, rows 450x375"`), and
//! `RAYON_NUM_THREADS=1` measures one thread.

#[path = "../../benches/stopwatch/mod.rs"]
mod stopwatch;
#[path = "../examples/demo/synthetic.rs"]
mod synthetic;

use hybank_ibr::camera::Camera;
use hybank_ibr::depth::DepthMap;
use hybank_ibr::image::Image;
use hybank_ibr::interpolate::plane::PlaneSettings;
use hybank_ibr::partial::densify;
use hybank_ibr::pipeline::{RenderSettings, Renderer};
use hybank_ibr::propagate::{CalibratedView, RectifiedView};
use stopwatch::time;
use synthetic::{SyntheticScene, rig_camera, rig_disparity};

struct View {
    image: Image,
    depth: DepthMap,
    disparity: DepthMap,
    camera: Camera,
    position: f64,
}

fn views(size: (usize, usize), positions: &[f64]) -> Vec<View> {
    let view = |position: f64| {
        let camera = Camera::metric(rig_camera(position, size), false).expect("a rig camera is regular");
        let (image, depth) = SyntheticScene::default().view(&camera, size);
        let disparity = rig_disparity(&depth, size.0);
        View { image, depth, disparity, camera, position }
    };
    positions.iter().copied().map(view).collect()
}

/// Whether the arguments choose a line.
fn chosen(name: &str) -> bool {
    let mut wanted = std::env::args().skip(1).filter(|argument| !argument.starts_with("--"));
    wanted.next().is_none_or(|part| name.contains(&part))
}

/// Times a task if its line is chosen.
fn time_chosen<T>(name: &str, task: impl FnMut() -> T) {
    if chosen(name) {
        time(name, task);
    }
}

fn full_depth(size: (usize, usize), positions: &[f64]) {
    let count = positions.len();
    let name = |method: &str| format!("{count} views, full depth, {method} {}x{}", size.0, size.1);
    if !["rows", "plane", "linear plane"].iter().any(|method| chosen(&name(method))) {
        return;
    }
    let views = views(size, positions);
    let rows: Vec<RectifiedView<'_>> = views
        .iter()
        .map(|v| RectifiedView { image: &v.image, map: &v.disparity, camera: v.position })
        .collect();
    let settings = RenderSettings::default();
    time_chosen(&name("rows"), || {
        Renderer::new(&rows, &settings).and_then(|rows| rows.render(&0.5, size)).expect("the views overlap")
    });
    let free: Vec<CalibratedView<'_>> =
        views.iter().map(|v| CalibratedView { image: &v.image, map: &v.depth, camera: v.camera }).collect();
    let target = Camera::metric(rig_camera(0.5, size), false).expect("a rig camera is regular");
    for (method, plane) in [("plane", PlaneSettings::CUBIC), ("linear plane", PlaneSettings::LINEAR)] {
        let mut settings = RenderSettings::default();
        settings.interpolation.plane = plane;
        time_chosen(&name(method), || {
            Renderer::new(&free, &settings).and_then(|free| free.render(&target, size)).expect("they overlap")
        });
    }
}

fn main() {
    for size in [(450, 375), (1920, 1080)] {
        full_depth(size, &[0.0, 1.0]);
        full_depth(size, &[-1.0, -0.7, -0.3, 0.0, 1.0, 1.3, 1.7, 2.0]);
    }
    let view = &views((450, 375), &[0.0])[0];
    let coarse = view.disparity.decimated(6).expect("known disparities");
    time_chosen("coarse depth, 450x375", || densify(&coarse, 6, &view.image));
}
