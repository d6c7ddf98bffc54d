//! Figures on photographs: skipped, with a note, where the data are not there.

use hybank_ibr::depth::{DepthMap, Measure, fill_unknown};
use hybank_ibr::image::{Image, quality, read_image, read_map};
use hybank_ibr::partial::{Densify, densify};
use hybank_ibr::pipeline::uncalibrated::{Target, UncalibratedSettings};
use hybank_ibr::pipeline::{Method, RenderSettings, rectified, uncalibrated};
use hybank_ibr::propagate::RectifiedView;
use hybank_ibr::uncalibrated::Point;
use std::path::{Path, PathBuf};

/// The data folder, or `None` with a printed note.
fn data(folder: &str) -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let root = std::env::var_os("HYBANK_DATA").map_or(beside, PathBuf::from);
    let path = root.join("ibr").join(folder);
    if !path.is_dir() {
        println!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}

struct Pair {
    images: [Image; 2],
    maps: [DepthMap; 2],
    truth: Option<Image>,
}

fn pair(folder: &str) -> Option<Pair> {
    let path = data(folder)?;
    let image = |name: &str| read_image(&path.join(name)).unwrap();
    let map = |name: &str| {
        let (width, height, stored) = read_map(&path.join(name)).unwrap();
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

fn psnr(pair: &Pair, settings: &RenderSettings) -> f64 {
    let view =
        |i: usize| RectifiedView { image: &pair.images[i], disparity: &pair.maps[i], position: i as f64 };
    let start = std::time::Instant::now();
    let got = rectified::render(&[view(0), view(1)], 0.5, settings).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let q = quality::compare(&got.image, pair.truth.as_ref().unwrap(), None).unwrap().unwrap();
    println!("{:.3} dB ssim {:.4} mae {:.3} {:?} {:.1} ms", q.psnr, q.ssim, q.mae, got.report, seconds * 1e3);
    q.psnr
}

#[test]
fn cones_full_depth() {
    let Some(pair) = pair("cones") else { return };
    let settings = RenderSettings::default();
    assert!(psnr(&pair, &settings) >= 28.6);
    assert!(psnr(&pair, &RenderSettings { offset: 0.25, ..settings }) >= 29.3);
    assert!(psnr(&pair, &RenderSettings { method: Method::Plane, ..settings }) >= 28.2);
}

#[test]
fn cones_with_three_percent_of_the_depths() {
    let Some(path) = data("cones") else { return };
    let dense = |method: &Densify| {
        let mut whole = pair("cones").unwrap();
        for (i, name) in ["disp2.png", "disp6.png"].iter().enumerate() {
            let (width, height, stored) = read_map(&path.join(name)).unwrap();
            let map = DepthMap::new((width, height), stored, 4.0, Measure::Disparity).unwrap();
            let start = std::time::Instant::now();
            whole.maps[i] = densify(&map.decimated(6).unwrap(), 6, &whole.images[i], method).unwrap();
            println!("densified in {:.0} ms", start.elapsed().as_secs_f64() * 1e3);
        }
        psnr(&whole, &RenderSettings::default())
    };
    let segmentwise = dense(&Densify::default());
    let bilinear = dense(&Densify::Bilinear);
    assert!(segmentwise >= 28.1, "{segmentwise}");
    assert!(segmentwise >= bilinear + 1.8, "{bilinear}");
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

fn house(first: usize, second: usize, wanted: usize) -> Option<(f64, usize, usize)> {
    let path = data("model_house")?;
    let image = |v: usize| read_image(&path.join(format!("house.{v:03}.png"))).unwrap();
    let (a, b, truth) = (image(first), image(second), image(wanted));
    let tracks = house_tracks(&path, &[first, second]);
    let target = Target::Tracks(house_tracks(&path, &[wanted]).into_iter().map(|t| t[0]).collect());
    let settings = RenderSettings::default();
    let start = std::time::Instant::now();
    let got = uncalibrated::render(
        &[&a, &b],
        &tracks,
        &target,
        truth.size(),
        &settings,
        &UncalibratedSettings::default(),
    )
    .unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let image = &got.rendering.image;
    let q = quality::compare(image, &truth, Some(&got.region)).unwrap().unwrap();
    let share = q.pixels as f64 / got.region.len() as f64;
    println!("({first}, {second}) -> {wanted}: {q:?} {share:.4} {seconds:.2} s");
    println!("{:?} {:?}", got.geometry, got.rendering.report);
    Some((q.psnr, got.geometry.inliers, got.geometry.matches))
}

#[test]
fn model_house() {
    let Some((psnr, inliers, matches)) = house(2, 4, 3) else { return };
    let (second, all, of) = house(1, 3, 2).unwrap();
    assert_eq!((inliers, matches), (340, 344));
    assert_eq!((all, of), (182, 182));
    assert!(psnr >= 30.7, "{psnr}");
    assert!(second >= 31.4, "{second}");
}
