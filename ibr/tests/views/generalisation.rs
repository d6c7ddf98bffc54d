//! The same defaults on scenes of quite different kinds: synthetic ones with an exact truth, and photographs
//! that the defaults were not chosen on. Each is compared with rounding every pixel to the nearest position
//! and keeping the nearest sample.

use crate::support::noise::noisy;
use crate::support::render::of_rig;
use hybank_ibr::depth::{DepthMap, Measure};
use hybank_ibr::image::{Image, quality};
use hybank_ibr::pipeline::RenderSettings;
use hybank_ibr::propagate::RectifiedView;

const WIDTH: usize = 200;
const HEIGHT: usize = 120;

/// A painted layer of disparity a + b X over the scene's column X: the camera at c sees X at X - c (a + b
/// X).
struct Layer {
    a: f64,
    b: f64,
    covers: fn(f64, f64) -> bool,
    paint: fn(f64, f64) -> f64,
}

/// Brightness and disparity of the nearest layer at a position in the camera's image.
fn look(layers: &[Layer], c: f64, x: f64, y: f64) -> (f64, f64) {
    let hits = layers.iter().filter_map(|l| {
        let column = (x + c * l.a) / (1.0 - c * l.b);
        (l.covers)(column, y).then(|| ((l.paint)(column, y), l.a + l.b * column))
    });
    hits.max_by(|p, q| p.1.total_cmp(&q.1)).expect("the last layer covers everything")
}

/// What a camera records: brightness averaged over 3 x 3 positions per pixel, 8 bits; disparity of the
/// pixel's centre.
fn record(layers: &[Layer], c: f64) -> (Image, DepthMap) {
    let position_of = |i: usize| ((i % WIDTH) as f64, (i / WIDTH) as f64);
    let grey = |i: usize| {
        let (x, y) = position_of(i);
        let part = |k: usize| (k as f64 - 1.0) / 3.0;
        (0..9).map(|k| look(layers, c, x + part(k % 3), y + part(k / 3)).0).sum::<f64>() as f32 / 9.0
    };
    let depth = |i: usize| look(layers, c, position_of(i).0, position_of(i).1).1 as f32;
    let image = Image::new(WIDTH, HEIGHT, 1, (0..WIDTH * HEIGHT).map(grey).collect()).unwrap().quantised();
    let map = (0..WIDTH * HEIGHT).map(depth).collect();
    (image, DepthMap::new((WIDTH, HEIGHT), map, 1.0, Measure::Disparity).unwrap())
}

fn waves(x: f64, y: f64, pitch: f64) -> f64 {
    let q = std::f64::consts::TAU / pitch;
    (q * (x + 0.4 * y)).sin() * (0.7 * q * y).cos() + 0.5 * (1.7 * q * (y - 0.3 * x)).sin()
}

/// Name, layers, and by how many dB the defaults must beat the baseline half-way and at 0.3.
fn scenes() -> Vec<(&'static str, Vec<Layer>, [f64; 2])> {
    let wall = |a, paint| Layer { a, b: 0.0, covers: |_, _| true, paint };
    let smooth_wall = || wall(4.0, |x, y| 90.0 + 40.0 * waves(x, y, 23.0));
    vec![
        (
            "fence of thin bars",
            vec![
                Layer {
                    a: 14.3,
                    b: 0.0,
                    covers: |x, _| x.rem_euclid(17.0) < 6.0,
                    paint: |x, y| 190.0 + 30.0 * waves(x, y, 9.0),
                },
                smooth_wall(),
            ],
            [3.0, 0.5],
        ),
        (
            "slanted plane",
            vec![Layer {
                a: 3.0,
                b: 0.05,
                covers: |_, _| true,
                paint: |x, y| 120.0 + 60.0 * waves(x, y, 15.0),
            }],
            [10.0, 14.0],
        ),
        (
            "fine texture on three depths",
            vec![
                Layer {
                    a: 17.6,
                    b: -0.02,
                    covers: |x, y| (x - 70.0).hypot(y - 50.0) < 28.0,
                    paint: |x, y| 130.0 + 70.0 * waves(x, y, 5.0),
                },
                Layer {
                    a: 9.4,
                    b: 0.0,
                    covers: |x, y| x + y > 210.0,
                    paint: |x, y| 120.0 + 60.0 * waves(y, x, 6.0),
                },
                wall(2.2, |x, y| 128.0 + 60.0 * waves(x, y, 7.0)),
            ],
            [1.5, 6.5],
        ),
        (
            "flat colours, wide baseline",
            vec![
                Layer {
                    a: 41.7,
                    b: 0.0,
                    covers: |x, y| (60.0..130.0).contains(&x) && y > 40.0,
                    paint: |_, _| 220.0,
                },
                wall(12.5, |x, _| if x.rem_euclid(31.0) < 15.0 { 60.0 } else { 110.0 }),
            ],
            [1.5, 3.5],
        ),
    ]
}

/// The baseline: each view rounded half up to whole pixels, nearest kept; views averaged where they agree
/// within 1 px, else the nearer; holes from the deeper side of the row.
fn rounded(views: &[RectifiedView<'_>], position: f64) -> Image {
    let (width, height) = views[0].image.size();
    let channels = views[0].image.channels();
    let mut out = Image::filled(width, height, channels, 0.0);
    for y in 0..height {
        let mut best: Vec<Option<(f64, Vec<f32>)>> = vec![None; width];
        for view in views {
            let mut own: Vec<Option<(f64, Vec<f32>)>> = vec![None; width];
            for (x, d) in view.map.row(y).iter().map(|d| f64::from(*d)).enumerate().filter(|p| !p.1.is_nan())
            {
                let column = (x as f64 + (view.camera - position) * d + 0.5).floor();
                let inside = column >= 0.0 && column < width as f64;
                if inside && own[column as usize].as_ref().is_none_or(|o| d > o.0) {
                    own[column as usize] =
                        Some((d, view.image.row(y)[x * channels..(x + 1) * channels].to_vec()));
                }
            }
            for (b, o) in best.iter_mut().zip(own) {
                *b = match (b.take(), o) {
                    (Some(p), Some(q)) if (p.0 - q.0).abs() <= 1.0 => {
                        Some((p.0.max(q.0), p.1.iter().zip(&q.1).map(|(a, b)| (a + b) / 2.0).collect()))
                    }
                    (Some(p), Some(q)) => Some(if p.0 >= q.0 { p } else { q }),
                    (p, q) => p.or(q),
                };
            }
        }
        for x in 0..width {
            let left = (0..=x).rev().find_map(|i| best[i].as_ref());
            let right = (x..width).find_map(|i| best[i].as_ref());
            let found = match (left, right) {
                (Some(l), Some(r)) => Some(if l.0 <= r.0 { l } else { r }),
                (l, r) => l.or(r),
            };
            if let Some((_, value)) = found {
                let at = (y * width + x) * channels;
                out.data_mut()[at..at + channels].copy_from_slice(value);
            }
        }
    }
    out
}

fn psnr(image: &Image, truth: &Image, region: Option<&[bool]>) -> f64 {
    quality::compare(image, truth, region).unwrap().unwrap().psnr
}

/// The margins are small where rounding is hard to beat: half-way between the views it errs by the same
/// fraction of a pixel in both, in opposite directions, so that their mean is right to first order; at 0.3
/// the bars' shift happens to be nearly whole in one view.
#[test]
fn every_kind_of_scene_is_held_against_rounding() {
    let mut behind = Vec::new();
    for (name, layers, margins) in scenes() {
        let ends = [record(&layers, 0.0), record(&layers, 1.0)];
        let view = |i: usize| RectifiedView { image: &ends[i].0, map: &ends[i].1, camera: i as f64 };
        let views = [view(0), view(1)];
        for (position, margin) in [0.5, 0.3].into_iter().zip(margins) {
            let (truth, _) = record(&layers, position);
            let baseline = psnr(&rounded(&views, position), &truth, None);
            let copy = psnr(&ends[0].0, &truth, None);
            let rows = of_rig(&views, position, &RenderSettings::default()).image;
            let rows = psnr(&rows, &truth, None);
            let figures =
                format!("{name} at {position}: rows {rows:.2}, rounded {baseline:.2}, copy {copy:.2} dB");
            println!("{figures}");
            if !(rows > baseline + margin && rows > copy + 5.0) {
                behind.push(figures);
            }
        }
    }
    assert!(behind.is_empty(), "{behind:#?}");
}

/// Against a fixed lambda, photographs without noise stay sharp and noise is smoothed; no scene loses much.
#[test]
fn the_smoothing_suits_the_noise() {
    for (noise, mean) in [([0.0, 0.0], 2.0), ([6.0, 6.0], 0.3), ([16.0, 16.0], 0.4), ([0.0, 16.0], 0.15)] {
        let gains: Vec<f64> = scenes().iter().map(|scene| gain_of_smoothing(&scene.1, noise)).collect();
        println!("noise {noise:?}: gains {gains:.2?} dB");
        assert!(gains.iter().all(|gain| *gain > -0.3), "{noise:?}: {gains:?}");
        assert!(gains.iter().sum::<f64>() > mean * gains.len() as f64, "{noise:?}: {gains:?}");
    }
}

/// The PSNR with the smoothing that the noise asks for over that with a fixed lambda.
fn gain_of_smoothing(layers: &[Layer], noise: [f64; 2]) -> f64 {
    let ends = [record(layers, 0.0), record(layers, 1.0)];
    let (truth, _) = record(layers, 0.5);
    let images = [noisy(&ends[0].0, noise[0], 1), noisy(&ends[1].0, noise[1], 2)];
    let view = |i: usize| RectifiedView { image: &images[i], map: &ends[i].1, camera: i as f64 };
    let quality =
        |settings: &RenderSettings| psnr(&of_rig(&[view(0), view(1)], 0.5, settings).image, &truth, None);
    let fixed = RenderSettings { keep_smoothing: true, ..RenderSettings::default() };
    quality(&RenderSettings::default()) - quality(&fixed)
}
