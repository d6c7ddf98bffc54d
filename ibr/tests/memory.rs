//! What renderings allocate at most, beside what they are estimated to take: sizes, shapes, views, methods.

use hybank_ibr::analysis::Predictor;
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::{DepthMap, Measure};
use hybank_ibr::image::Image;
use hybank_ibr::interpolate::Degree;
use hybank_ibr::interpolate::plane::PlaneSettings;
use hybank_ibr::pipeline::memory::Extent;
use hybank_ibr::pipeline::uncalibrated::{self, Target, UncalibratedSettings};
use hybank_ibr::pipeline::{Method, RenderError, RenderSettings, calibrated, rectified};
use hybank_ibr::propagate::{CalibratedView, RectifiedView};
use hybank_ibr::restore::{self, restore};
use hybank_ibr::synthetic::{SyntheticScene, rig_camera};
use nalgebra::{Matrix3x4, Vector3};

type Size = (usize, usize);

/// Runs `work` on one thread, whose allocations are counted; the most bytes at a time.
fn peak(pool: &rayon::ThreadPool, work: impl FnOnce() + Send) -> f64 {
    let mut most = 0.0;
    pool.install(|| most = allocation_counter::measure(work).bytes_max as f64);
    most
}

fn pool() -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().unwrap()
}

/// What estimates are compared with.
#[derive(Default)]
struct Estimates {
    wrong: Vec<String>,
}

impl Estimates {
    /// The estimate is true within a quarter.
    fn compare(&mut self, name: &str, size: Size, estimate: f64, measured: f64) {
        let (pixels, ratio) = ((size.0 * size.1) as f64, estimate / measured);
        let line = format!(
            "{name}: {:.1} MB, {:.1} bytes per pixel, ratio {ratio:.2}",
            measured / 1e6,
            measured / pixels
        );
        println!("{line}");
        if !(0.75..1.25).contains(&ratio) {
            self.wrong.push(line);
        }
    }
}

impl Drop for Estimates {
    fn drop(&mut self) {
        assert!(self.wrong.is_empty() || std::thread::panicking(), "{:#?}", self.wrong);
    }
}

fn picture((width, height): Size, channels: usize) -> Image {
    let value = |i: usize| 120.0 + 80.0 * ((i / channels % width) as f32 * 0.4).sin() + (i % 7) as f32;
    Image::new(width, height, channels, (0..width * height * channels).map(value).collect()).unwrap()
}

fn map(size: Size, value: f32, measure: Measure) -> DepthMap {
    DepthMap::new(size, vec![value; size.0 * size.1], 1.0, measure).unwrap()
}

/// With errors, as measured depth has: predictions render the view with other ones too.
fn noisy_map(size: Size, value: f32, measure: Measure, seed: usize) -> DepthMap {
    let error = |i: usize| ((i + seed) * 7919 % 1013) as f32 / 1013.0 - 0.5;
    let data = (0..size.0 * size.1).map(|i| value * (1.0 + 0.01 * error(i)) + 0.2 * error(i / 3));
    DepthMap::new(size, data.collect(), 1.0, measure).unwrap()
}

/// Large views in every campaign, smaller ones always.
fn scaled((width, height): Size) -> Size {
    let factor = if std::env::var_os("HYBANK_CAMPAIGN").is_some() { 2 } else { 1 };
    (if width > 16 { factor * width } else { width }, if height > 16 { factor * height } else { height })
}

#[test]
fn rows_take_what_is_estimated() {
    let pool = pool();
    let mut estimates = Estimates::default();
    for (size, views, channels) in [
        ((700, 500), 2, 3),
        ((700, 500), 1, 1),
        ((500, 700), 5, 3),
        ((60_000, 6), 2, 3),
        ((120_000, 1), 2, 1),
        ((6, 60_000), 3, 3),
        ((1, 200_000), 2, 1),
    ] {
        let (size, settings) = (scaled(size), RenderSettings::default());
        let (image, map) = (picture(size, channels), map(size, 0.3, Measure::Disparity));
        let view = |camera: usize| RectifiedView { image: &image, map: &map, camera: camera as f64 };
        let views: Vec<_> = (0..views).map(view).collect();
        let images: Vec<&Image> = views.iter().map(|view| view.image).collect();
        let estimate = pool.install(|| Extent::new(size, &images, None).of_rig(&settings));
        let measured = peak(&pool, || drop(rectified::render(&views, 0.4, &settings).unwrap()));
        estimates.compare(
            &format!("rows, {size:?}, {} views, {channels} channels", views.len()),
            size,
            estimate,
            measured,
        );
    }
}

fn looking(x: f64, (width, height): Size) -> Camera {
    let focal = 0.8 * width.max(height) as f64;
    let centre = Vector3::new(x, 0.0, 0.0);
    let k = nalgebra::Matrix3::new(
        focal,
        0.0,
        (width as f64 - 1.0) / 2.0,
        0.0,
        focal,
        (height as f64 - 1.0) / 2.0,
        0.0,
        0.0,
        1.0,
    );
    let mut matrix = Matrix3x4::zeros();
    matrix.fixed_columns_mut::<3>(0).copy_from(&k);
    matrix.set_column(3, &-(k * centre));
    Camera::metric(matrix, false).unwrap()
}

/// Virtual views that the photographs cover, and such that are mostly holes, where multigrid takes over.
#[test]
fn planes_take_what_is_estimated() {
    let pool = pool();
    let mut estimates = Estimates::default();
    for (size, of_views, views, channels, degree) in [
        ((600, 500), (600, 500), 2, 3, Degree::Linear),
        ((600, 500), (600, 500), 2, 1, Degree::Cubic),
        ((600, 500), (24, 16), 2, 3, Degree::Linear),
        ((600, 500), (24, 16), 3, 3, Degree::Cubic),
        ((300, 200), (600, 500), 6, 3, Degree::Linear),
        ((1, 300_000), (24, 16), 2, 3, Degree::Linear),
        ((300_000, 1), (24, 16), 2, 1, Degree::Linear),
        ((3, 100_000), (24, 16), 2, 3, Degree::Cubic),
        ((12, 30_000), (24, 16), 2, 3, Degree::Linear),
        ((100_000, 3), (24, 16), 2, 1, Degree::Cubic),
    ] {
        let (size, of_views) = (scaled(size), scaled(of_views));
        let mut settings = RenderSettings::default();
        if degree == Degree::Linear {
            settings.interpolation.plane = PlaneSettings::LINEAR;
        }
        // Few steps: the memory does not depend on them.
        settings.interpolation.plane.iterations = 60;
        let (image, map) = (picture(of_views, channels), map(of_views, 5.0, Measure::Depth));
        let view = |k: usize| CalibratedView {
            image: &image,
            map: &map,
            camera: looking(0.02 * k as f64, of_views),
        };
        let (views, target): (Vec<_>, _) = ((0..views).map(view).collect(), looking(0.01, of_views));
        let extent = calibrated::extent(&views, &target, size, &settings).unwrap();
        let estimate = pool.install(|| extent.of_cameras(&settings));
        let work = || drop(calibrated::render(&views, &target, size, &settings).unwrap());
        let name = format!("plane, {size:?} from {} of {of_views:?}, {channels}, {degree:?}", views.len());
        estimates.compare(&name, size, estimate, peak(&pool, work));
    }
}

#[test]
fn planes_of_rigs_take_what_is_estimated() {
    let pool = pool();
    let mut estimates = Estimates::default();
    for size in [(600, 500), (4, 80_000)] {
        let (size, settings) = (scaled(size), RenderSettings { method: Method::Plane, ..Default::default() });
        let (image, map) = (picture(size, 3), map(size, 0.3, Measure::Disparity));
        let views = [0.0, 1.0].map(|camera| RectifiedView { image: &image, map: &map, camera });
        let estimate = pool.install(|| Extent::new(size, &[&image, &image], None).of_rig(&settings));
        let measured = peak(&pool, || drop(rectified::render(&views, 0.4, &settings).unwrap()));
        estimates.compare(&format!("plane of a rig, {size:?}"), size, estimate, measured);
    }
}

#[test]
fn views_from_tracks_take_what_is_estimated() {
    let pool = pool();
    let mut estimates = Estimates::default();
    for (size, views) in [((500, 400), 2), ((300, 240), 4), ((180, 150), 2)] {
        let (size, of_views) = (scaled(size), scaled((400, 320)));
        let cameras: Vec<Camera> = (0..=views)
            .map(|k| Camera::metric(rig_camera(0.7 * k as f64, of_views), false).unwrap())
            .collect();
        let shots: Vec<Image> =
            cameras.iter().map(|c| SyntheticScene::default().view(c, of_views).0).collect();
        let point = |i: usize| {
            let part = |k: usize| ((i * k + 7) % 211) as f64 / 211.0;
            Vector3::new(3.0 * part(37) - 1.5, 2.0 * part(53) - 1.0, 4.0 + 3.0 * part(89))
        };
        let seen = |i: usize, camera: &Camera| {
            let (x, y, _) = camera.project(&point(i));
            let inside = x > 0.0 && y > 0.0 && x < of_views.0 as f64 - 1.0 && y < of_views.1 as f64 - 1.0;
            inside.then(|| nalgebra::Vector2::new(x, y))
        };
        let tracks: Vec<Vec<_>> =
            (0..120).map(|i| cameras[..views].iter().map(|c| seen(i, c)).collect()).collect();
        let images: Vec<&Image> = shots[..views].iter().collect();
        let (settings, special) = (RenderSettings::default(), UncalibratedSettings::default());
        let target = Target::Between(0.5);
        let work = || {
            drop(
                uncalibrated::render(&images, &tracks, &target, size, &settings, &special, &|_| ()).unwrap(),
            );
        };
        // What a process allocates once for all is no part of a rendering.
        pool.install(work);
        let measured = peak(&pool, work);
        let estimate = Extent::new(size, &images, None).of_tracks();
        estimates.compare(&format!("tracks, {size:?} from {views}"), size, estimate, measured);
    }
}

#[test]
fn predictions_take_what_is_estimated() {
    let pool = pool();
    let mut estimates = Estimates::default();
    for (size, channels) in [((400, 300), 3), ((300, 400), 1), ((20_000, 6), 3)] {
        let (size, settings) = (scaled(size), RenderSettings::default());
        let image = picture(size, channels);
        let maps = [1, 2].map(|seed| noisy_map(size, 0.8, Measure::Disparity, seed));
        let view = |k: usize| RectifiedView { image: &image, map: &maps[k], camera: k as f64 };
        let views = [0, 1].map(view);
        let estimate = pool.install(|| Extent::new(size, &[&image, &image], None).of_rig_prediction());
        let work = || {
            let predictor = Predictor::new(&views, &settings).unwrap();
            drop(predictor.at(&0.5, views[0].image.size()).unwrap());
        };
        estimates.compare(&format!("prediction of a rig, {size:?}"), size, estimate, peak(&pool, work));
        let maps = [1, 2].map(|seed| noisy_map(size, 5.0, Measure::Depth, seed));
        let target = looking(0.01, size);
        let view = |k: usize| CalibratedView {
            image: &image,
            map: &maps[k],
            camera: looking(0.02 * k as f64, size),
        };
        let views = [0, 1].map(view);
        let extent = calibrated::extent(&views, &target, size, &settings).unwrap();
        let estimate = pool.install(|| extent.of_camera_prediction(&settings));
        let work = || {
            let predictor = Predictor::new(&views, &settings).unwrap();
            drop(predictor.at(&target, size).unwrap());
        };
        estimates.compare(&format!("prediction of cameras, {size:?}"), size, estimate, peak(&pool, work));
    }
}

/// Maps without any error, with outliers, and with noise that is smoothed.
#[test]
fn restored_maps_take_what_is_estimated() {
    let pool = pool();
    let mut estimates = Estimates::default();
    for (size, views) in [((600, 500), 2), ((500, 700), 4), ((90_000, 4), 2)] {
        let size = scaled(size);
        let image = picture(size, 3);
        let clean = map(size, 4.0, Measure::Disparity);
        let wild = |i: usize| if i.is_multiple_of(61) { 9.0 + (i % 5) as f32 } else { 4.0 };
        let wild = DepthMap::new(size, (0..size.0 * size.1).map(wild).collect(), 1.0, Measure::Disparity);
        let noisy: Vec<DepthMap> =
            (0..views).map(|k| noisy_map(size, 40.0, Measure::Disparity, 1 + 17 * k)).collect();
        let same = |map: &DepthMap| vec![map.clone(); views];
        for (name, maps, is_noisy) in [
            ("clean", same(&clean), false),
            ("outliers", same(&wild.unwrap()), false),
            ("noise", noisy, true),
        ] {
            let view = |k: usize| RectifiedView { image: &image, map: &maps[k], camera: k as f64 };
            let views: Vec<_> = (0..views).map(view).collect();
            let estimate = restore::memory(&vec![size; views.len()], is_noisy);
            let measured = peak(&pool, || drop(restore(&views).unwrap()));
            estimates.compare(
                &format!("restored, {name}, {size:?} x {}", views.len()),
                size,
                estimate,
                measured,
            );
        }
    }
}

/// No machine has 10^16 bytes; the message has what is wanted and what is there.
#[test]
fn what_no_memory_holds_is_refused() {
    let size = (24, 16);
    let (image, map) = (picture(size, 1), map(size, 5.0, Measure::Depth));
    let view = CalibratedView { image: &image, map: &map, camera: looking(0.0, size) };
    let refused = calibrated::render(
        &[view],
        &looking(0.01, size),
        (1 << 16, (1 << 16) - 1),
        &RenderSettings::default(),
    );
    assert!(matches!(refused, Err(RenderError::Memory { .. })), "{refused:?}");
    let message = refused.unwrap_err().to_string();
    assert!(
        message.contains("65536 x 65535") && message.contains("of memory, and this process may use"),
        "{message}"
    );
}

/// What parsing takes, beside the text. The estimates are not low: what is refused for lack of memory is
/// refused before it is parsed.
#[test]
fn texts_take_what_is_estimated() {
    let n = 200_000;
    let list = |item: &str| format!("a = [{}]\n", item.repeat(n));
    let keys = |key: &str| (0..n).map(|k| format!("k{k}{key}")).collect::<String>();
    let object = |member: &str| (0..n).map(|k| format!("\"{k}\":{member},")).collect::<String>();
    let pool = pool();
    for (name, highest, text) in [
        ("a string", 4.0, format!("a = \"{}\"\n", "x".repeat(5 * n))),
        ("integers", 1.4, list("1,")),
        ("numbers", 1.4, list("1.5, ")),
        ("long numbers", 1.4, list("1.2345678901234567, ")),
        ("strings", 1.4, list("\"x\",")),
        ("lists", 1.4, list("[1],")),
        ("tables in a line", 1.4, list("{b=1},")),
        ("empty tables", 7.0, list("{},")),
        ("keys", 1.4, keys(" = 1\n")),
        ("dotted keys", 1.4, keys(".b.c.1 = 1\n")),
        ("tables", 1.4, "[[view]]\nposition = 1.0\n".repeat(n)),
        ("comments", 3.0, "# nothing\n".repeat(n)),
        ("empty lines", 1.4, "\n".repeat(n)),
        ("JSON: numbers", 1.8, format!("{{\"a\": [{}1]}}", "1.5, ".repeat(n))),
        ("JSON: members", 2.0, format!("{{{}\"a\":1}}", object("1"))),
        ("JSON: objects", 1.8, format!("{{{}\"a\":1}}", object("{\"b\":1}"))),
    ] {
        let estimate = hybank::files::parsing_bytes(text.as_bytes());
        let measured = peak(&pool, || match text.starts_with('{') {
            true => drop(serde_json::from_str::<serde_json::Value>(&text)),
            false => drop(hybank_ibr::scene::parse(&text, std::path::Path::new("scene.toml"))),
        });
        let ratio = estimate / measured;
        println!("{name}: {:.1} MB, ratio {ratio:.2}", measured / 1e6);
        assert!((0.75..highest).contains(&ratio), "{name}: {estimate} estimated, {measured} measured");
    }
}
