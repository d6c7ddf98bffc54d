//! An analytic ray tracer: a wall, a floor, four spheres and a card, with exact depth. Independent of the
//! crate's own synthetic scene and of its cameras' arithmetic.

use hybank_ibr::camera::Camera;
use hybank_ibr::depth::{DepthMap, Measure};
use hybank_ibr::image::Image;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, Vector3};

pub(crate) const SIZE: (usize, usize) = (320, 240);
const FOCAL: f64 = 300.0;
const RAYS: usize = 4;

type V = Vector3<f64>;

/// A pinhole camera: centre, yaw and focal length in pixels.
#[derive(Clone, Copy)]
pub(crate) struct Eye {
    pub(crate) centre: [f64; 3],
    pub(crate) yaw: f64,
    pub(crate) zoom: f64,
}

pub(crate) const fn eye(x: f64, y: f64, z: f64) -> Eye {
    Eye { centre: [x, y, z], yaw: 0.0, zoom: 1.0 }
}

impl Eye {
    fn rotation(&self) -> Rotation3<f64> {
        Rotation3::from_euler_angles(0.0, self.yaw, 0.0)
    }

    pub(crate) fn camera(&self) -> Camera {
        let (cx, cy) = ((SIZE.0 as f64 - 1.0) / 2.0, (SIZE.1 as f64 - 1.0) / 2.0);
        let f = FOCAL * self.zoom;
        let k = Matrix3::new(f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0);
        let r = self.rotation().inverse();
        let mut rt = Matrix3x4::zeros();
        rt.fixed_columns_mut::<3>(0).copy_from(r.matrix());
        rt.set_column(3, &-(r * V::from(self.centre)));
        Camera::metric(k * rt, false).unwrap()
    }

    /// The ray through a position of the image, with unit depth.
    fn ray(&self, x: f64, y: f64) -> V {
        let (cx, cy) = ((SIZE.0 as f64 - 1.0) / 2.0, (SIZE.1 as f64 - 1.0) / 2.0);
        let f = FOCAL * self.zoom;
        self.rotation() * V::new((x - cx) / f, (y - cy) / f, 1.0)
    }
}

/// Depth and colour where a ray first meets the scene.
fn trace(origin: &V, ray: &V) -> (f64, [f64; 3]) {
    let mut best = (f64::INFINITY, [0.0; 3]);
    let mut offer = |depth: f64, colour: &dyn Fn(V) -> [f64; 3]| {
        if depth > 1e-6 && depth < best.0 {
            best = (depth, colour(origin + ray * depth));
        }
    };
    offer((9.0 - origin.z) / ray.z, &|p| paint(p.x, p.y, 0.9, [130.0, 120.0, 110.0]));
    offer((1.5 - origin.y) / ray.y, &|p| paint(p.x, p.z, 1.3, [110.0, 130.0, 100.0]));
    for (k, (centre, radius)) in SPHERES.iter().enumerate() {
        let o = origin - V::from(*centre);
        let (a, b, c) = (ray.norm_squared(), o.dot(ray), o.norm_squared() - radius * radius);
        if b * b >= a * c {
            let base =
                [[190.0, 90.0, 80.0], [90.0, 170.0, 190.0], [200.0, 180.0, 90.0], [120.0, 90.0, 170.0]][k];
            offer((-b - (b * b - a * c).sqrt()) / a, &|p| {
                paint(p.x + 0.4 * p.z, p.y - 0.3 * p.z, 0.55, base)
            });
        }
    }
    let (centre, normal) = (V::new(-0.75, 0.35, 4.6), V::new(0.35, -0.15, -1.0));
    let depth = normal.dot(&(centre - origin)) / normal.dot(ray);
    let local = origin + ray * depth - centre;
    if local.x.abs() < 0.55 && local.y.abs() < 0.4 {
        offer(depth, &|p| paint(p.x, p.y, 0.4, [205.0, 205.0, 195.0]));
    }
    best
}

const SPHERES: [([f64; 3], f64); 4] =
    [([0.9, 0.5, 5.0], 0.75), ([-1.6, -0.6, 7.0], 0.9), ([0.3, -0.9, 6.0], 0.6), ([2.0, 0.9, 7.6], 0.6)];

/// Smooth paint with details of `pitch` scene units.
fn paint(u: f64, v: f64, pitch: f64, base: [f64; 3]) -> [f64; 3] {
    let q = std::f64::consts::TAU / pitch;
    let a = (q * (u + 0.3 * v)).sin() * (0.8 * q * v).cos();
    let b = (0.47 * q * (v - 0.6 * u)).sin();
    std::array::from_fn(|c| (base[c] + 30.0 * a + 20.0 * b * (c as f64 - 0.6)).clamp(0.0, 255.0))
}

/// Photograph (8 bits, 4 x 4 rays per pixel) and exact depth of the pixel centres.
pub(crate) fn shoot(eye: &Eye) -> (Image, DepthMap) {
    let origin = V::from(eye.centre);
    let (width, height) = SIZE;
    let mut values = Vec::with_capacity(width * height * 3);
    let mut depths = Vec::with_capacity(width * height);
    for p in 0..width * height {
        let (x, y) = ((p % width) as f64, (p / width) as f64);
        let mut sum = [0.0; 3];
        for k in 0..RAYS * RAYS {
            let part = |i: usize| (i as f64 + 0.5) / RAYS as f64 - 0.5;
            let (_, colour) = trace(&origin, &eye.ray(x + part(k % RAYS), y + part(k / RAYS)));
            sum.iter_mut().zip(colour).for_each(|(s, c)| *s += c);
        }
        values.extend(sum.map(|s| (s / (RAYS * RAYS) as f64).round() as f32));
        depths.push(trace(&origin, &eye.ray(x, y)).0 as f32);
    }
    let depth = DepthMap::new(SIZE, depths, 1.0, Measure::Depth).unwrap();
    (Image::new(width, height, 3, values).unwrap(), depth)
}
