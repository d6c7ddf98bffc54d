//! The predicted error of views against the measured one: on photographs, which are skipped with a note
//! where the data are not there, and on scenes with exact references.

use crate::ray_traced::scene;
use crate::support::render::of_rig;
use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};
use hybank_ibr::analysis::{Predictor, ViewError};
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::{DepthMap, Measure, fill_unknown};
use hybank_ibr::image::{Image, MOST_PIXELS, read_image, read_map};
use hybank_ibr::pipeline::RenderSettings;
use hybank_ibr::propagate::{CalibratedView, RectifiedView};
use trials::random::Random;

/// Side of the blocks over which errors are ranked, in pixels.
const BLOCK: usize = 16;

/// Views of a rectified rig, and photographs from other places.
struct Rig {
    images: Vec<Image>,
    maps: Vec<DepthMap>,
    positions: Vec<f64>,
}

impl Rig {
    fn views(&self, which: &[usize]) -> Vec<RectifiedView<'_>> {
        let view = |i: &usize| RectifiedView {
            image: &self.images[*i],
            map: &self.maps[*i],
            camera: self.positions[*i],
        };
        which.iter().map(view).collect()
    }
}

/// Absolute error of each pixel after rounding to 8 bits, mean over the channels.
fn errors(image: &Image, truth: &Image) -> Vec<f64> {
    let channels = image.channels();
    let (a, b) = (image.quantised(), truth.quantised());
    let pairs = a.data().chunks(channels).zip(b.data().chunks(channels));
    let of_pixel =
        |(p, q): (&[f32], &[f32])| p.iter().zip(q).map(|(p, q)| f64::from((p - q).abs())).sum::<f64>();
    pairs.map(|pair| of_pixel(pair) / channels as f64).collect()
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / count
}

fn blocks(values: &[f64], (width, height): (usize, usize)) -> Vec<f64> {
    let pixels = |b: usize| {
        let (left, top) = (b % (width / BLOCK) * BLOCK, b / (width / BLOCK) * BLOCK);
        (0..BLOCK * BLOCK).map(move |k| (top + k / BLOCK) * width + left + k % BLOCK)
    };
    (0..(width / BLOCK) * (height / BLOCK)).map(|b| mean(pixels(b).map(|p| values[p]))).collect()
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    order.into_iter().enumerate().for_each(|(rank, i)| ranks[i] = rank as f64);
    ranks
}

/// Rank correlation (Spearman) over the blocks of an image.
fn correlation(a: &[f64], b: &[f64], size: (usize, usize)) -> f64 {
    let (a, b) = (ranks(&blocks(a, size)), ranks(&blocks(b, size)));
    let middle = (a.len() as f64 - 1.0) / 2.0;
    let covariance: f64 = a.iter().zip(&b).map(|(x, y)| (x - middle) * (y - middle)).sum();
    covariance / a.iter().map(|x| (x - middle) * (x - middle)).sum::<f64>()
}

/// Central differences along the rows of the rendered view.
fn gradient(image: &Image) -> Vec<f64> {
    let (width, channels) = (image.width(), image.channels());
    let value = |p: usize, c: usize| f64::from(image.data()[p * channels + c]);
    let slope = |p: usize| {
        let column = p % width;
        let (left, right) = (p - column.min(1), p + usize::from(column + 1 < width));
        mean((0..channels).map(|c| (value(right, c) - value(left, c)).abs() / 2.0))
    };
    (0..image.width() * image.height()).map(slope).collect()
}

/// How good a prediction is.
#[derive(Debug)]
#[allow(dead_code)]
struct Verdict {
    measured: f64,
    ratio: f64,
    rank: f64,
    gradient: f64,
    residual: f64,
    psnr: [f64; 2],
}

fn judge(
    name: &str,
    predicted: &ViewError,
    views: &[RectifiedView<'_>],
    position: f64,
    truth: &Image,
) -> Verdict {
    let image = &predicted.rendering.image;
    let size = image.size();
    let measured = errors(image, truth);
    let estimate: Vec<f64> = predicted.estimate.iter().map(|v| f64::from(*v)).collect();
    let square =
        mean(image.quantised().data().iter().zip(truth.data()).map(|(a, b)| f64::from(a - b).powi(2)));
    let verdict = Verdict {
        measured: mean(measured.iter().copied()),
        ratio: mean(estimate.iter().copied()) / mean(measured.iter().copied()),
        rank: correlation(&estimate, &measured, size),
        gradient: correlation(&gradient(image), &measured, size),
        residual: correlation(&residual(views, position, image), &measured, size),
        psnr: [predicted.totals().psnr, 10.0 * (255.0 * 255.0 / square).log10()],
    };
    println!(
        "{name}: {verdict:.3?} {:.3?} causes {:.2?} {:?}",
        predicted.totals(),
        predicted.causes,
        predicted.calibration
    );
    verdict
}

/// The left-right residual alone: difference between the renderings from the first and from the last view;
/// 0 with one view.
fn residual(views: &[RectifiedView<'_>], position: f64, image: &Image) -> Vec<f64> {
    if views.len() < 2 {
        return vec![0.0; image.width() * image.height()];
    }
    let alone = |v: RectifiedView<'_>| of_rig(&[v], position, &RenderSettings::default()).image;
    errors(&alone(views[0]), &alone(views[views.len() - 1]))
}

fn predict(name: &str, rig: &Rig, which: &[usize], position: f64, truth: &Image, offset: f64) -> Verdict {
    let views = rig.views(which);
    let settings = RenderSettings { offset, ..RenderSettings::default() };
    let predicted = Predictor::new(&views, &settings).unwrap().at(&position, views[0].image.size()).unwrap();
    judge(name, &predicted, &views, position, truth)
}

fn photographs(folder: &str) -> Option<(Rig, Option<Image>)> {
    let path = trials::data(&format!("ibr/{folder}"))?;
    let map = |name: &str| {
        let (width, height, stored) = read_map(&path.join(name), MOST_PIXELS).unwrap();
        let mut map = DepthMap::new((width, height), stored, 4.0, Measure::Disparity).unwrap();
        fill_unknown(&mut map);
        map
    };
    let image = |name: &str| read_image(&path.join(name), MOST_PIXELS).unwrap();
    let truth = path.join("im4.png").is_file().then(|| image("im4.png"));
    let rig = Rig {
        images: vec![image("im2.png"), image("im6.png")],
        maps: vec![map("disp2.png"), map("disp6.png")],
        positions: vec![0.0, 1.0],
    };
    Some((rig, truth))
}

#[test]
fn photographs_between_two_views() {
    let Some((rig, Some(truth))) = photographs("cones") else { return };
    let plain = predict("cones", &rig, &[0, 1], 0.5, &truth, 0.0);
    let shifted = predict("cones, offset", &rig, &[0, 1], 0.5, &truth, 0.25);
    for v in [plain, shifted] {
        assert!((0.8..1.25).contains(&v.ratio), "{v:?}");
        assert!(v.rank > v.gradient.max(v.residual) + 0.05, "{v:?}");
    }
}

#[test]
fn photographs_from_one_view() {
    for folder in ["cones", "teddy"] {
        let Some((rig, _)) = photographs(folder) else { return };
        for (from, to) in if folder == "cones" { vec![(0, 1)] } else { vec![(0, 1), (1, 0)] } {
            let v = predict(
                &format!("{folder} {to} from {from}"),
                &rig,
                &[from],
                to as f64,
                &rig.images[to],
                0.0,
            );
            assert!((0.8..1.25).contains(&v.ratio), "{v:?}");
            assert!(v.rank > v.gradient.max(v.residual) + 0.05, "{v:?}");
        }
    }
}

/// The ray-traced scene as a rectified rig: positions in units of 0.4, disparities 300 px * 0.4 / depth.
fn ray_traced(positions: &[f64]) -> Rig {
    let shot = |position: &f64| scene::shoot(&scene::eye(0.4 * (position - 0.5), 0.0, 0.0));
    let (images, depths): (Vec<Image>, Vec<DepthMap>) = positions.iter().map(shot).unzip();
    let disparity = |depth: &DepthMap| {
        let data = depth.data().iter().map(|d| 120.0 / d).collect();
        DepthMap::new(scene::SIZE, data, 1.0, Measure::Disparity).unwrap()
    };
    Rig { images, maps: depths.iter().map(disparity).collect(), positions: positions.to_vec() }
}

fn plain(positions: &[f64]) -> Rig {
    synthetic(&SyntheticScene::default(), positions, (240, 180))
}

fn synthetic(scene: &SyntheticScene, positions: &[f64], size: (usize, usize)) -> Rig {
    let shot = |position: &f64| {
        let camera = Camera::metric(rig_camera(*position, size), false).unwrap();
        let (image, depth) = scene.view(&camera, size);
        (image.quantised(), rig_disparity(&depth, size.0))
    };
    let (images, maps) = positions.iter().map(shot).unzip();
    Rig { images, maps, positions: positions.to_vec() }
}

/// The same rig as cameras and stereo programs give it: noise of the standard deviation `noise` grey levels,
/// disparities in steps of `step` pixels.
fn degraded(rig: &Rig, noise: f64, step: f32) -> Rig {
    let mut random = Random(5);
    let mut bell = || noise * (2.0 * (random.part() + random.part() + random.part()) - 3.0);
    let mut images = rig.images.clone();
    for image in &mut images {
        image
            .data_mut()
            .iter_mut()
            .for_each(|v| *v = (f64::from(*v) + bell()).clamp(0.0, 255.0).round() as f32);
    }
    let coarse = |map: &DepthMap| {
        let values = map.data().iter().map(|d| (d / step).round() * step).collect();
        DepthMap::new(map.size(), values, 1.0, Measure::Disparity).unwrap()
    };
    Rig { images, maps: rig.maps.iter().map(coarse).collect(), positions: rig.positions.clone() }
}

/// Scenes that nothing was chosen on, with noise and coarse disparities, for positions between and beside.
#[test]
fn scenes_with_noise_and_coarse_disparities() {
    let all = trials::is_slow("noise and coarse disparities of all scenes");
    let positions = [0.0, 1.0, 0.5, 0.3];
    let cases = [(vec![0, 1], 3), (vec![0, 1], 2), (vec![0, 1, 2], 3)];
    let (scenes, cases) = if all { (2, &cases[..]) } else { (1, &cases[..1]) };
    let rigs = [("synthetic", plain as fn(&[f64]) -> Rig), ("ray-traced", ray_traced)];
    for (name, make) in rigs.into_iter().take(scenes) {
        let exact = make(&positions);
        for (noise, step) in [(3.0, 0.25), (1.5, 1.0)] {
            let rig = degraded(&exact, noise, step);
            for (which, target) in cases {
                let target = *target;
                let title = format!("{name} {noise} {step} {which:?}");
                let truth = &rig.images[target];
                let v = predict(&title, &rig, which, positions[target], truth, 0.0);
                assert!((0.8..1.25).contains(&v.ratio), "{title}: {v:?}");
            }
        }
    }
}

/// Exact inputs: the error is a third of a grey level, most of it the rounding to 8 bits.
#[test]
fn scenes_with_exact_inputs() {
    let positions = [0.0, 1.0, 0.5];
    for (name, rig) in [("ray-traced", ray_traced(&positions)), ("synthetic", plain(&positions))] {
        let v = predict(name, &rig, &[0, 1], 0.5, &rig.images[2], 0.0);
        // Views that are left out are rendered from one side, at twice the distance.
        assert!((0.8..1.5).contains(&v.ratio), "{name}: {v:?}");
    }
}

/// General cameras: three that do not stand on a line, one nearer, with noise; the view between them.
#[test]
fn views_of_general_cameras() {
    let eyes = [scene::eye(-0.25, 0.0, 0.0), scene::eye(0.2, 0.05, 0.3), scene::eye(0.0, -0.2, 0.1)];
    let target = scene::eye(0.0, 0.0, 0.1);
    let mut random = Random(11);
    let shots: Vec<(Image, DepthMap)> = eyes.iter().map(scene::shoot).collect();
    let mut bell = || 2.0 * (random.part() + random.part() + random.part()) - 3.0;
    let mut worn: Vec<(Image, DepthMap)> = Vec::new();
    for (image, depth) in &shots {
        let mut image = image.clone();
        image.data_mut().iter_mut().for_each(|v| *v = (*v + 2.0 * bell() as f32).clamp(0.0, 255.0).round());
        let values = depth.data().iter().map(|d| d * (1.0 + 0.004 * bell() as f32)).collect();
        worn.push((image, DepthMap::new(scene::SIZE, values, 1.0, Measure::Depth).unwrap()));
    }
    let views: Vec<CalibratedView<'_>> = worn
        .iter()
        .zip(&eyes)
        .map(|((image, depth), eye)| CalibratedView { image, map: depth, camera: eye.camera() })
        .collect();
    let mut truth = scene::shoot(&target).0;
    truth.data_mut().iter_mut().for_each(|v| *v = (*v + 2.0 * bell() as f32).clamp(0.0, 255.0).round());
    let settings = RenderSettings::default();
    let predicted = Predictor::new(&views, &settings).unwrap().at(&target.camera(), scene::SIZE).unwrap();
    let image = &predicted.rendering.image;
    let measured = errors(image, &truth);
    let estimate: Vec<f64> = predicted.estimate.iter().map(|v| f64::from(*v)).collect();
    let ratio = mean(estimate.iter().copied()) / mean(measured.iter().copied());
    let rank = correlation(&estimate, &measured, scene::SIZE);
    let noise = predicted.calibration.disparity_noise;
    println!(
        "general cameras: ratio {ratio:.3}, rank {rank:.3}, depth noise {noise:.4}, {:.2?}",
        predicted.causes
    );
    assert!((0.8..1.25).contains(&ratio) && rank > 0.4, "{ratio} {rank}");
    assert!((noise / 0.004 - 1.0).abs() < 0.25, "{noise}");
    assert!(predicted.totals().expected >= mean(estimate));
}
