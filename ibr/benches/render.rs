//! How long a view takes: rows and plane, two sizes, mean shift, uncalibrated geometry.
//!
//! The views are those of the synthetic scene, so that the inputs repeat exactly.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::DepthMap;
use hybank_ibr::image::Image;
use hybank_ibr::pipeline::{Method, RenderSettings, calibrated, rectified};
use hybank_ibr::propagate::{CalibratedView, RectifiedView};
use hybank_ibr::segment::MeanShift;
use hybank_ibr::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use std::hint::black_box;

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

fn two_views_full_depth(c: &mut Criterion) {
    let mut group = c.benchmark_group("two views, full depth");
    for size in [(450, 375), (1920, 1080)] {
        let views = views(size);
        group.throughput(Throughput::Elements((size.0 * size.1) as u64)).sample_size(10);
        let rows: Vec<RectifiedView<'_>> = views
            .iter()
            .map(|v| RectifiedView { image: &v.image, disparity: &v.disparity, position: v.position })
            .collect();
        let settings = RenderSettings { method: Method::Rows, ..RenderSettings::default() };
        group.bench_function(format!("rows {}x{}", size.0, size.1), |b| {
            b.iter(|| black_box(rectified::render(&rows, 0.5, &settings).expect("the views overlap")));
        });
        let free: Vec<CalibratedView<'_>> = views
            .iter()
            .map(|v| CalibratedView { image: &v.image, depth: &v.depth, camera: v.camera })
            .collect();
        let target = Camera::metric(rig_camera(0.5, size), false).expect("a rig camera is regular");
        let settings = RenderSettings::default();
        group.bench_function(format!("plane {}x{}", size.0, size.1), |b| {
            b.iter(|| black_box(calibrated::render(&free, &target, size, &settings).expect("they overlap")));
        });
    }
    group.finish();
}

fn mean_shift(c: &mut Criterion) {
    let mut group = c.benchmark_group("mean shift");
    let image = &views((450, 375))[0].image;
    group.throughput(Throughput::Elements(450 * 375)).sample_size(10);
    group.bench_function("450x375", |b| {
        b.iter(|| black_box(MeanShift::default().segment(image).expect("default settings")));
    });
    group.finish();
}

criterion_group!(benches, two_views_full_depth, mean_shift);
criterion_main!(benches);
