//! A scene under a sky: a ground, balls, and infinity, seen by four cameras, with exact depth.

use hybank_ibr::image::{Image, pfm, save};
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};

type V = Vector3<f64>;

const SIZE: (usize, usize) = (320, 240);
const FOCAL: f64 = 280.0;
const RAYS: usize = 3;

struct Eye {
    centre: V,
    rotation: Rotation3<f64>,
}

impl Eye {
    fn new(centre: [f64; 3], yaw: f64, pitch: f64) -> Self {
        Self { centre: V::from(centre), rotation: Rotation3::from_euler_angles(pitch, yaw, 0.0) }
    }

    /// The ray through a position of the image, with unit depth.
    fn ray(&self, x: f64, y: f64) -> V {
        let (cx, cy) = ((SIZE.0 as f64 - 1.0) / 2.0, (SIZE.1 as f64 - 1.0) / 2.0);
        self.rotation * V::new((x - cx) / FOCAL, (y - cy) / FOCAL, 1.0)
    }

    /// The rows of the camera matrix, as a scene file has them.
    fn matrix(&self) -> String {
        let (cx, cy) = ((SIZE.0 as f64 - 1.0) / 2.0, (SIZE.1 as f64 - 1.0) / 2.0);
        let k = Matrix3::new(FOCAL, 0.0, cx, 0.0, FOCAL, cy, 0.0, 0.0, 1.0);
        let m = k * self.rotation.inverse().matrix();
        let t = -(m * self.centre);
        let row = |i: usize| format!("[{}, {}, {}, {}]", m[(i, 0)], m[(i, 1)], m[(i, 2)], t[i]);
        format!("[{}, {}, {}]", row(0), row(1), row(2))
    }
}

/// Depth and colour where a ray first meets the scene; the colour of the sky depends on the direction.
fn trace(origin: &V, ray: &V) -> (f64, [f64; 3]) {
    let direction = ray.normalize();
    let clouds = paint(direction.x * 6.0, direction.y * 6.0, 0.5, [150.0, 180.0, 215.0]);
    let mut best = (f64::INFINITY, clouds);
    let mut offer = |depth: f64, pitch: f64, base: [f64; 3]| {
        if depth > 1e-6 && depth < best.0 {
            let p = origin + ray * depth;
            best = (depth, paint(p.x + 0.4 * p.z, p.y - 0.3 * p.z, pitch, base));
        }
    };
    // The ground ends at a hill, so that nothing recedes into the horizon.
    let ground = (1.2 - origin.y) / ray.y;
    if (origin + ray * ground).z < 14.0 {
        offer(ground, 1.1, [110.0, 125.0, 90.0]);
    }
    for (x, y, z, radius, base) in [
        (0.8, 0.3, 5.0, 0.8, [190.0, 90.0, 80.0]),
        (-1.5, -0.2, 7.0, 0.9, [90.0, 150.0, 190.0]),
        (2.6, -0.6, 9.0, 1.2, [200.0, 180.0, 90.0]),
        (-3.0, 0.2, 10.0, 1.4, [120.0, 90.0, 170.0]),
    ] {
        let o = origin - V::new(x, y, z);
        let (a, b, c) = (ray.norm_squared(), o.dot(ray), o.norm_squared() - radius * radius);
        if b * b >= a * c {
            offer((-b - (b * b - a * c).sqrt()) / a, 0.6, base);
        }
    }
    best
}

/// Smooth paint with details of `pitch`.
fn paint(u: f64, v: f64, pitch: f64, base: [f64; 3]) -> [f64; 3] {
    let q = std::f64::consts::TAU / pitch;
    let (a, b) = ((q * (u + 0.3 * v)).sin() * (0.8 * q * v).cos(), (0.47 * q * (v - 0.6 * u)).sin());
    std::array::from_fn(|c| (base[c] + 28.0 * a + 18.0 * b * (c as f64 - 0.6)).clamp(0.0, 255.0))
}

fn shoot(eye: &Eye) -> Result<(Image, Image), Box<dyn Error>> {
    let (mut values, mut depths) = (Vec::new(), Vec::new());
    for p in 0..SIZE.0 * SIZE.1 {
        let (x, y) = ((p % SIZE.0) as f64, (p / SIZE.0) as f64);
        let mut sum = [0.0; 3];
        for k in 0..RAYS * RAYS {
            let part = |i: usize| (i as f64 + 0.5) / RAYS as f64 - 0.5;
            let (_, colour) = trace(&eye.centre, &eye.ray(x + part(k % RAYS), y + part(k / RAYS)));
            sum.iter_mut().zip(colour).for_each(|(s, c)| *s += c);
        }
        values.extend(sum.map(|s| (s / (RAYS * RAYS) as f64) as f32));
        depths.push(trace(&eye.centre, &eye.ray(x, y)).0 as f32);
    }
    Ok((Image::new(SIZE.0, SIZE.1, 3, values)?, Image::new(SIZE.0, SIZE.1, 1, depths)?))
}

/// Writes the scene into a folder; the scene file and the true view.
pub(crate) fn write(folder: &Path) -> Result<(PathBuf, PathBuf), Box<dyn Error>> {
    let eyes = [
        Eye::new([-0.8, -0.1, 0.1], 0.07, 0.02),
        Eye::new([0.8, 0.1, 0.0], -0.06, -0.02),
        Eye::new([-0.7, 0.2, 0.3], 0.04, -0.04),
        Eye::new([0.7, -0.2, 0.2], -0.08, 0.03),
    ];
    let mut text = String::new();
    for (k, eye) in eyes.iter().enumerate() {
        let (image, depth) = shoot(eye)?;
        save(&image, &folder.join(format!("sky{k}.png")))?;
        std::fs::write(folder.join(format!("sky{k}.pfm")), pfm::encode(&depth))?;
        let matrix = eye.matrix();
        writeln!(text, "[[view]]\nimage = \"sky{k}.png\"\ndepth = \"sky{k}.pfm\"\ncamera = {matrix}")?;
    }
    let middle = Eye::new([0.0, 0.0, 0.1], 0.0, 0.0);
    let truth = folder.join("sky_truth.png");
    save(&shoot(&middle)?.0, &truth)?;
    writeln!(text, "[virtual]\ncamera = {}", middle.matrix())?;
    let path = folder.join("sky.toml");
    std::fs::write(&path, text)?;
    Ok((path, truth))
}
