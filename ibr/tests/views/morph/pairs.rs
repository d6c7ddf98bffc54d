//! Pairs of synthetic photographs with tracks, and the view between them.

use crate::support::normal::normal;
use crate::synthetic::SyntheticScene;
use hybank_ibr::camera::Camera;
use hybank_ibr::depth::DepthMap;
use hybank_ibr::image::Image;
use hybank_ibr::uncalibrated::Point;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, Vector3};

/// Standard deviation of the positions of tracks that are made, in pixels.
const NOISE: f64 = 0.25;

pub(crate) struct Pair {
    pub(crate) name: String,
    pub(crate) images: Vec<Image>,
    pub(crate) tracks: Vec<Vec<Option<Point>>>,
    pub(crate) target: Vec<Option<Point>>,
    pub(crate) truth: Image,
}

/// Pixels of an image in a sequence that covers it evenly.
fn scattered((width, height): (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    (1..200_000).map(move |k| ((k * 7919) % width, (k * 104_729 / 7) % height))
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
