//! Pairs of photographs with tracks, and the view between them.

use crate::support::normal::normal;
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::DepthMap;
use hybank_ibr::image::{Image, MOST_PIXELS, read_image, read_map};
use hybank_ibr::scene::{self, Kind, LoadOptions};
use hybank_ibr::synthetic::SyntheticScene;
use hybank_ibr::uncalibrated::Point;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, Vector3};
use std::path::{Path, PathBuf};

/// Standard deviation of the positions of tracks that are made, in pixels.
const NOISE: f64 = 0.25;

pub(crate) struct Pair {
    pub(crate) name: String,
    pub(crate) images: Vec<Image>,
    pub(crate) tracks: Vec<Vec<Option<Point>>>,
    pub(crate) target: Vec<Option<Point>>,
    pub(crate) truth: Image,
}

/// The pairs whose photographs are there; the tests' list of what was skipped has the others.
pub(crate) fn of_data() -> impl Iterator<Item = Pair> {
    let path = |folder: &str| trials::data(&format!("ibr/{folder}"));
    let houses = [([2, 4], 3), ([1, 3], 2), ([0, 2], 1), ([0, 3], 1), ([1, 4], 2), ([0, 4], 2)];
    let house = path("model_house").into_iter();
    let houses = house.flat_map(move |path| houses.map(|(from, wanted)| house_pair(&path, from, wanted)));
    let rigs = [("cones", 4.0), ("poster1", 8.0)].into_iter();
    let rigs = rigs.filter_map(move |(name, scale)| Some(rig(&path(name)?, scale)));
    houses
        .chain(rigs)
        .chain(["spheres", "grid"].into_iter().filter_map(move |name| Some(traced(&path(name)?))))
}

fn name(path: &Path) -> String {
    path.file_name().unwrap().to_string_lossy().into_owned()
}

/// Photographs of Model House, with the tracks that belong to them.
fn house_pair(path: &Path, from: [usize; 2], wanted: usize) -> Pair {
    let views = [from[0], from[1], wanted];
    let text = |name: String| std::fs::read_to_string(path.join(name)).unwrap();
    let point = |line: &str| {
        let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        Point::new(numbers[0], numbers[1])
    };
    let corners = views.map(|v| text(format!("house.{v:03}.corners")).lines().map(point).collect::<Vec<_>>());
    let all = text("house.nview-corners".into());
    let column = |k: usize| {
        let number = |line: &str| line.split_whitespace().nth(views[k]).unwrap().parse::<usize>().ok();
        all.lines().map(|line| Some(corners[k][number(line)?])).collect::<Vec<_>>()
    };
    let tracks = column(0).into_iter().zip(column(1)).map(|(a, b)| vec![a, b]).collect();
    let image = |v: usize| read_image(&path.join(format!("house.{v:03}.png")), MOST_PIXELS).unwrap();
    let images = from.map(image).to_vec();
    Pair { name: format!("house {from:?} {wanted}"), images, tracks, target: column(2), truth: image(wanted) }
}

/// Pixels of an image in a sequence that covers it evenly.
fn scattered((width, height): (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    (1..200_000).map(move |k| ((k * 7919) % width, (k * 104_729 / 7) % height))
}

/// A rectified rig of Middlebury: 500 tracks where both maps agree.
fn rig(path: &Path, scale: f32) -> Pair {
    let (width, height, left) = read_map(&path.join("disp2.png"), MOST_PIXELS).unwrap();
    let (_, _, right) = read_map(&path.join("disp6.png"), MOST_PIXELS).unwrap();
    let seen = |(x, y): (usize, usize)| {
        let d = left[y * width + x] / scale;
        let there = x as f32 - d;
        let agrees = d > 0.0 && there >= 0.0;
        let other = right[y * width + if agrees { there.round() as usize } else { 0 }] / scale;
        let at = |shift: f32| Point::new(f64::from(x as f32 - shift), y as f64);
        (agrees && (d - other).abs() <= 0.6).then(|| [at(0.0), at(d), at(d / 2.0)])
    };
    let image = |name: &str| read_image(&path.join(name), MOST_PIXELS).unwrap();
    let points = scattered((width, height)).filter_map(seen).take(500).collect();
    noisy(&name(path), vec![image("im2.png"), image("im6.png")], points, image("im4.png"))
}

/// A scene of general cameras: 400 tracks.
fn traced(path: &Path) -> Pair {
    let file: PathBuf = path.join("scene.toml");
    let spec = scene::parse(&std::fs::read_to_string(&file).unwrap(), &file).unwrap();
    let loaded = scene::load(&spec, &file, &LoadOptions::default(), &|_| ()).unwrap();
    let Kind::Calibrated { views, cameras, .. } = loaded.kind else { panic!("{}", file.display()) };
    let shots = views.into_iter().map(|v| Shot { image: v.image, map: v.map, camera: v.camera }).collect();
    of_shots(&name(path), shots, &cameras[0], read_image(&path.join("truth.png"), MOST_PIXELS).unwrap(), 400)
}

/// Photographs of a synthetic scene: 250 tracks.
pub(crate) fn ray_traced(seed: u64) -> Pair {
    let camera = |side: f64| {
        let focal = 380.0 + 30.0 * seed as f64;
        let k = Matrix3::new(focal, 0.0, 159.5, 0.0, focal, 119.5, 0.0, 0.0, 1.0);
        let turn = Rotation3::from_euler_angles(0.01 * side, -0.1 * side, 0.02);
        let mut m = Matrix3x4::zeros();
        m.fixed_columns_mut::<3>(0).copy_from(turn.matrix());
        m.set_column(3, &-(turn * Vector3::new(0.7 * side, 0.05 * side, 0.0)));
        Camera::metric(k * m, false).unwrap()
    };
    let scene = SyntheticScene::varied(seed);
    let shot = |side: f64| {
        let (image, map) = scene.view(&camera(side), (320, 240));
        Shot { image, map, camera: camera(side) }
    };
    let wanted = shot(0.1);
    let name = format!("ray-traced {seed}");
    of_shots(&name, [-0.5, 0.5].map(shot).into(), &wanted.camera, wanted.image, 250)
}

struct Shot {
    image: Image,
    map: DepthMap,
    camera: Camera,
}

impl Shot {
    fn depth(&self, x: usize, y: usize) -> f64 {
        f64::from(self.map.row(y)[x])
    }
}

/// Tracks of points that the first two shots and the camera see.
fn of_shots(name: &str, shots: Vec<Shot>, camera: &Camera, truth: Image, count: usize) -> Pair {
    let nearest = nearest(&shots, camera, truth.size());
    let (there, virtually) =
        (shots[0].camera.relative_to(&shots[1].camera), shots[0].camera.relative_to(camera));
    let within = |(u, v): (f64, f64), (width, height): (usize, usize)| {
        (u >= 0.0 && v >= 0.0 && u <= width as f64 - 1.0 && v <= height as f64 - 1.0)
            .then(|| (u.round() as usize, v.round() as usize))
    };
    let seen = |(x, y): (usize, usize)| {
        let depth = shots[0].depth(x, y);
        let ((u, v, d), (p, q, s)) =
            (there.map(x as f64, y as f64, depth), virtually.map(x as f64, y as f64, depth));
        let (i, j) = within((u, v), shots[1].map.size())?;
        let (k, l) = within((p, q), truth.size())?;
        let is_seen =
            (shots[1].depth(i, j) / d - 1.0).abs() <= 0.02 && s <= 1.03 * nearest[l * truth.width() + k];
        is_seen.then(|| [Point::new(x as f64, y as f64), Point::new(u, v), Point::new(p, q)])
    };
    let points = scattered(shots[0].map.size()).filter_map(seen).take(count).collect();
    noisy(name, shots.into_iter().take(2).map(|shot| shot.image).collect(), points, truth)
}

/// The depth that a camera sees in each pixel, by all shots.
fn nearest(shots: &[Shot], camera: &Camera, (width, height): (usize, usize)) -> Vec<f64> {
    let mut nearest = vec![f64::MAX; width * height];
    for shot in shots {
        let (map, columns) = (shot.camera.relative_to(camera), shot.map.width());
        for pixel in 0..columns * shot.map.height() {
            let (x, y) = (pixel % columns, pixel / columns);
            let (u, v, depth) = map.map(x as f64, y as f64, shot.depth(x, y));
            for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
                let (p, q) = ((u + f64::from(i)).round(), (v + f64::from(j)).round());
                if depth > 0.0 && p >= 0.0 && q >= 0.0 && p < width as f64 && q < height as f64 {
                    let least: &mut f64 = &mut nearest[q as usize * width + p as usize];
                    *least = least.min(depth);
                }
            }
        }
    }
    nearest
}

/// The pair with noise on its tracks.
fn noisy(name: &str, images: Vec<Image>, points: Vec<[Point; 3]>, truth: Image) -> Pair {
    let mut normal = normal(5);
    let mut shaken = |p: Point| Some(p + NOISE * Point::new(normal(), normal()));
    let points: Vec<[Option<Point>; 3]> = points.into_iter().map(|track| track.map(&mut shaken)).collect();
    let tracks = points.iter().map(|track| track[..2].to_vec()).collect();
    let target = points.iter().map(|track| track[2]).collect();
    Pair { name: name.into(), images, tracks, target, truth }
}
