//! Figures on photographs: skipped, with a note, where the data are not there.

use crate::support::noise::noisy;
use crate::support::normal::normal;
use crate::support::render::of_rig;
use hybank_ibr::depth::{DepthMap, Measure, fill_unknown};
use hybank_ibr::image::{Image, MOST_PIXELS, quality, read_image, read_map};
use hybank_ibr::pipeline::uncalibrated::{Target, UncalibratedRendering, UncalibratedSettings};
use hybank_ibr::pipeline::{Agreement, RenderSettings, uncalibrated};
use hybank_ibr::propagate::RectifiedView;
use hybank_ibr::restore::restore;
use hybank_ibr::uncalibrated::Point;
use std::path::{Path, PathBuf};

/// The data folder, or `None` with a printed note.
fn data(folder: &str) -> Option<PathBuf> {
    trials::data(&format!("ibr/{folder}"))
}

struct Pair {
    images: [Image; 2],
    maps: [DepthMap; 2],
    truth: Option<Image>,
}

fn pair(folder: &str) -> Option<Pair> {
    let path = data(folder)?;
    let image = |name: &str| read_image(&path.join(name), MOST_PIXELS).unwrap();
    let map = |name: &str| {
        let (width, height, stored) = read_map(&path.join(name), MOST_PIXELS).unwrap();
        let mut map = DepthMap::new((width, height), stored, 4.0, Measure::Disparity).unwrap();
        fill_unknown(&mut map);
        map
    };
    Some(Pair {
        images: [image("im2.png"), image("im6.png")],
        maps: [map("disp2.png"), map("disp6.png")],
        truth: path.join("im4.png").is_file().then(|| image("im4.png")),
    })
}

fn views(pair: &Pair) -> [RectifiedView<'_>; 2] {
    [0, 1].map(|i| RectifiedView { image: &pair.images[i], map: &pair.maps[i], camera: i as f64 })
}

fn psnr(pair: &Pair, settings: &RenderSettings) -> f64 {
    let start = std::time::Instant::now();
    let got = of_rig(&views(pair), 0.5, settings);
    let seconds = start.elapsed().as_secs_f64();
    let q = quality::compare(&got.image, pair.truth.as_ref().unwrap(), None).unwrap().unwrap();
    println!("{:.3} dB ssim {:.4} mae {:.3} {:?} {:.1} ms", q.psnr, q.ssim, q.mae, got.report, seconds * 1e3);
    q.psnr
}

#[test]
fn cones_full_depth() {
    let Some(pair) = pair("cones") else { return };
    let settings = RenderSettings::default();
    assert!(psnr(&pair, &settings) >= 29.2);
    assert!(psnr(&pair, &RenderSettings { offset: 0.25, ..settings }) >= 30.3);
}

/// At the place of a photograph that photograph counts most; equal weights gave 33.4 dB.
#[test]
fn at_a_photographs_own_place() {
    for folder in ["cones", "teddy"] {
        let Some(pair) = pair(folder) else { return };
        for (place, own) in pair.images.iter().enumerate() {
            let got = of_rig(&views(&pair), place as f64, &RenderSettings::default());
            let psnr = quality::compare(&got.image, own, None).unwrap().unwrap().psnr;
            println!("{folder} at view {place}: {psnr:.2} dB");
            assert!(psnr >= 40.7, "{folder} {place}: {psnr}");
        }
    }
}

/// White noise of 24 grey levels: lambda = 0.1 gave 24.3 dB where both photographs have it, and equal
/// weights 26.0 dB where one has it.
#[test]
fn noise_is_smoothed_and_counts_less() {
    for (noise, least) in [([24.0, 24.0], 25.2), ([0.0, 24.0], 28.2)] {
        let Some(mut pair) = pair("cones") else { return };
        for (seed, (image, noise)) in (1..).zip(pair.images.iter_mut().zip(noise)) {
            *image = noisy(image, noise, seed);
        }
        assert!(psnr(&pair, &RenderSettings { offset: 0.25, ..RenderSettings::default() }) >= least);
    }
}

/// The map with white errors of this standard deviation. None of its values counts as guessed.
fn erroneous(map: &DepthMap, deviation: f64, seed: u64) -> DepthMap {
    let mut normal = normal(seed);
    let values = map.data().iter().map(|v| (v + (deviation * normal()) as f32).max(0.1 * v)).collect();
    DepthMap::new(map.size(), values, 1.0, map.measure()).unwrap()
}

/// White errors of disparity, in pixels, in one map or in both: they are measured, and smoothed when a scene
/// is read. Without that the views have 28.0, 28.7, 27.8 and 27.2 dB.
#[test]
fn errors_of_depth_are_measured_and_smoothed() {
    let all = [([1.0, 1.0], 29.1), ([0.0, 2.0], 28.5), ([1.0, 0.0], 29.3), ([0.0, 1.0], 28.9)];
    let count = if trials::is_slow("errors of depth in either map") { 4 } else { 2 };
    for (errors, least) in all.into_iter().take(count) {
        let Some(mut pair) = pair("cones") else { return };
        for (seed, (map, error)) in (11..).zip(pair.maps.iter_mut().zip(errors)) {
            *map = erroneous(map, error, seed);
        }
        let found = Agreement::of(&views(&pair)).depth_errors;
        println!("errors {errors:?}, found {found:.2?}");
        assert!(found.iter().zip(errors).all(|(found, error)| (found - error).abs() <= 0.15), "{found:?}");
        let restored = restore(&views(&pair));
        pair.maps.iter_mut().zip(restored).for_each(|(map, restored)| *map = restored.map);
        assert!(psnr(&pair, &RenderSettings::default()) >= least);
    }
}

/// Each view from the other one alone.
#[test]
fn single_views() {
    let Some(pair) = pair("teddy") else { return };
    for (place, least) in [23.1, 26.8].into_iter().enumerate() {
        let settings = RenderSettings::default();
        let got = of_rig(&views(&pair)[1 - place..2 - place], place as f64, &settings);
        let psnr = quality::compare(&got.image, &pair.images[place], None).unwrap().unwrap().psnr;
        println!("teddy, view {place} from the other: {psnr:.2} dB");
        assert!(psnr >= least, "{place}: {psnr}");
    }
}

/// Tracks of the Model House over some views: the corner files and the table of their indices.
fn house_tracks(path: &Path, views: &[usize]) -> Vec<Vec<Option<Point>>> {
    let text = |name: String| std::fs::read_to_string(path.join(name)).unwrap();
    let corners: Vec<Vec<Point>> = views
        .iter()
        .map(|v| {
            let number = |w: &str| w.parse::<f64>().unwrap();
            let point = |line: &str| {
                let mut words = line.split_whitespace().map(number);
                Point::new(words.next().unwrap(), words.next().unwrap())
            };
            text(format!("house.{v:03}.corners")).lines().map(point).collect()
        })
        .collect();
    let row = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let column = |(k, v): (usize, &usize)| words[*v].parse::<usize>().ok().map(|i| corners[k][i]);
        views.iter().enumerate().map(column).collect()
    };
    text("house.nview-corners".into()).lines().map(row).collect()
}

/// A view of the Model House and its photograph.
struct House {
    done: UncalibratedRendering,
    truth: Image,
}

impl House {
    fn psnr(&self, region: &[bool]) -> f64 {
        quality::compare(&self.done.rendering.image, &self.truth, Some(region)).unwrap().unwrap().psnr
    }
}

fn house(from: &[usize], wanted: usize) -> Option<House> {
    let path = data("model_house")?;
    let image = |v: &usize| read_image(&path.join(format!("house.{v:03}.png")), MOST_PIXELS).unwrap();
    let (images, truth) = (from.iter().map(image).collect::<Vec<_>>(), image(&wanted));
    let tracks = house_tracks(&path, from);
    let target = Target::Tracks(house_tracks(&path, &[wanted]).into_iter().map(|t| t[0]).collect());
    let images: Vec<&Image> = images.iter().collect();
    let (settings, special) = (RenderSettings::default(), UncalibratedSettings::default());
    let done = uncalibrated::render(&images, &tracks, &target, truth.size(), &settings, &special).unwrap();
    let house = House { done, truth };
    let region = &house.done.region;
    let share = region.iter().filter(|inside| **inside).count() as f64 / region.len() as f64;
    println!("{from:?} -> {wanted}: {:.2} dB on {share:.4} of the image", house.psnr(region));
    println!("{:?} {:?}", house.done.geometry, house.done.rendering.report);
    Some(house)
}

#[test]
fn model_house() {
    let Some(first) = house(&[2, 4], 3) else { return };
    let second = house(&[1, 3], 2).unwrap();
    let matches = |house: &House| (house.done.geometry.inliers, house.done.geometry.matches);
    assert_eq!((matches(&first), matches(&second)), ((340, 344), (182, 182)));
    let [first, second] = [&first, &second].map(|house| house.psnr(&house.done.region));
    assert!(first >= 31.0 && second >= 31.7, "{first} {second}");
}
