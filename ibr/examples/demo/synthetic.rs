//! A synthetic scene with exact depth: a reference for renderings without a photograph.
//!
//! Curved and slanted textured surfaces in front of a wall, seen by any pinhole camera. Colours are
//! averaged over 3 x 3 rays per pixel, depth is that of the central ray.

#![allow(dead_code, reason = "each of those who draw the scene uses a part")]

use hybank_ibr::camera::Camera;
use hybank_ibr::depth::{DepthMap, Measure};
use hybank_ibr::image::Image;
use nalgebra::{Matrix3x4, Vector3};
use rayon::prelude::*;

/// Rays per pixel in each direction.
const RAYS: usize = 3;

/// A surface that rays can hit.
enum Surface {
    /// The points with normal . X = offset within a radius around a centre (infinite for the wall).
    Disc { normal: Vector3<f64>, centre: Vector3<f64>, radius: f64 },
    /// A ball.
    Ball { centre: Vector3<f64>, radius: f64 },
}

impl Surface {
    /// The least positive depth at which origin + depth * ray meets the surface.
    fn hit(&self, origin: &Vector3<f64>, ray: &Vector3<f64>) -> Option<f64> {
        let depth = match self {
            Self::Disc { normal, centre, radius } => {
                let depth = normal.dot(&(centre - origin)) / normal.dot(ray);
                let apart = (origin + ray * depth - centre).norm();
                (apart <= *radius).then_some(depth)
            }
            Self::Ball { centre, radius } => {
                let (o, r2) = (origin - centre, ray.norm_squared());
                let half = o.dot(ray) / r2;
                let square = half * half - (o.norm_squared() - radius * radius) / r2;
                (square >= 0.0).then(|| -half - square.sqrt())
            }
        };
        depth.filter(|d| d.is_finite() && *d > 1e-6)
    }
}

/// A painted surface.
struct Painted {
    surface: Surface,
    base: [f64; 3],
    pitch: f64,
}

impl Painted {
    /// Smooth stripes and spots of about `pitch` scene units.
    fn colour(&self, p: &Vector3<f64>) -> [f64; 3] {
        let q = p * (std::f64::consts::TAU / self.pitch);
        let stripes = (q.x + 0.6 * q.y).sin() + 0.7 * (1.3 * q.y - 0.4 * q.x + 0.9 * q.z).sin();
        let spots = (0.7 * q.x).cos() * (0.8 * q.y + 0.3 * q.z).cos();
        std::array::from_fn(|c| self.base[c] + 26.0 * stripes + 22.0 * spots * (c as f64 - 0.8))
    }
}

/// The scene: a slanted wall, a ball and two discs at depths from 3 to 9.
pub(crate) struct SyntheticScene {
    surfaces: Vec<Painted>,
}

impl Default for SyntheticScene {
    fn default() -> Self {
        let disc = |normal: [f64; 3], centre: [f64; 3], radius| Surface::Disc {
            normal: Vector3::from(normal).normalize(),
            centre: Vector3::from(centre),
            radius,
        };
        let ball = Surface::Ball { centre: Vector3::new(0.9, 0.35, 5.2), radius: 0.9 };
        let painted = |surface, base, pitch| Painted { surface, base, pitch };
        Self {
            surfaces: vec![
                painted(disc([0.12, 0.05, -1.0], [0.0, 0.0, 9.0], f64::INFINITY), [120.0, 130.0, 150.0], 0.9),
                painted(ball, [170.0, 110.0, 90.0], 0.5),
                painted(disc([-0.35, 0.1, -1.0], [-1.1, -0.3, 4.2], 0.8), [100.0, 160.0, 110.0], 0.45),
                painted(disc([0.2, -0.3, -1.0], [0.1, -0.75, 3.3], 0.35), [190.0, 180.0, 90.0], 0.3),
            ],
        }
    }
}

impl SyntheticScene {
    /// The wall with a ball and three discs at places that depend on the seed: other scenes of one kind.
    pub(crate) fn varied(seed: u64) -> Self {
        // Fractional parts of multiples of the golden ratio and its kin: spread evenly, without a generator.
        let part = |k: u64| (0.618_033_988_75 * (seed * 31 + k * 7 + 1) as f64).fract();
        let between = |k: u64, low: f64, high: f64| low + (high - low) * part(k);
        let centre = |k: u64| [between(k, -1.3, 1.3), between(k + 1, -0.8, 0.8), between(k + 2, 3.3, 6.5)];
        let disc = |k: u64| Surface::Disc {
            normal: Vector3::new(between(k + 3, -0.4, 0.4), between(k + 4, -0.3, 0.3), -1.0).normalize(),
            centre: Vector3::from(centre(k)),
            radius: between(k + 5, 0.3, 0.8),
        };
        let ball = Surface::Ball { centre: Vector3::from(centre(40)), radius: between(43, 0.3, 0.8) };
        let mut scene = Self::default();
        scene.surfaces.truncate(1);
        for (k, surface) in [disc(0), disc(10), disc(20), ball].into_iter().enumerate() {
            let k = k as u64;
            let base = std::array::from_fn(|c| between(50 + 3 * k + c as u64, 70.0, 190.0));
            scene.surfaces.push(Painted { surface, base, pitch: between(70 + k, 0.3, 0.8) });
        }
        scene
    }

    /// Image (RGB) and depth of the scene for a metric camera. The wall fills every view that looks along
    /// +z.
    pub(crate) fn view(&self, camera: &Camera, (width, height): (usize, usize)) -> (Image, DepthMap) {
        let mut colours = vec![0.0_f32; width * height * 3];
        let mut depths = vec![f32::NAN; width * height];
        let rows = colours.par_chunks_exact_mut(width * 3).zip(depths.par_chunks_exact_mut(width));
        rows.enumerate().for_each(|(y, (colours, depths))| {
            for x in 0..width {
                let centre = self.trace(camera, x as f64, y as f64);
                depths[x] = centre.map_or(f32::NAN, |hit| hit.0 as f32);
                let colour = self.average(camera, x as f64, y as f64);
                colours[3 * x..3 * x + 3].iter_mut().zip(colour).for_each(|(p, c)| *p = c as f32);
            }
        });
        let mut image = Image::filled(width, height, 3, 0.0);
        image.data_mut().copy_from_slice(&colours);
        (image, map((width, height), depths, Measure::Depth))
    }

    fn average(&self, camera: &Camera, x: f64, y: f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for k in 0..RAYS * RAYS {
            let offset = |i: usize| (i as f64 + 0.5) / RAYS as f64 - 0.5;
            if let Some((_, colour)) = self.trace(camera, x + offset(k % RAYS), y + offset(k / RAYS)) {
                sum.iter_mut().zip(colour).for_each(|(s, c)| *s += c);
            }
        }
        sum.map(|s| (s / (RAYS * RAYS) as f64).clamp(0.0, 255.0))
    }

    /// Depth and colour of the nearest surface on the ray through a position in the image.
    fn trace(&self, camera: &Camera, x: f64, y: f64) -> Option<(f64, [f64; 3])> {
        let origin = camera.centre();
        let ray = camera.unproject(x, y, 1.0) - origin;
        let hits = self.surfaces.iter().filter_map(|s| Some((s.surface.hit(&origin, &ray)?, s)));
        let (depth, painted) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((depth, painted.colour(&(origin + ray * depth))))
    }
}

/// Focal length of [`rig_camera`] in units of the image width.
pub(crate) const RIG_FOCAL: f64 = 0.9;
/// Distance between the rig's cameras 0 and 1 in scene units.
pub(crate) const RIG_BASELINE: f64 = 0.35;

/// Camera of a rectified rig at `position` (in baselines) looking along +z.
pub(crate) fn rig_camera(position: f64, (width, height): (usize, usize)) -> Matrix3x4<f64> {
    let focal = RIG_FOCAL * width as f64;
    let (cx, cy) = ((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0);
    let shift = -focal * RIG_BASELINE * (position - 0.5);
    Matrix3x4::new(focal, 0.0, cx, shift, 0.0, focal, cy, 0.0, 0.0, 0.0, 1.0, 0.0)
}

/// Disparity of the rig for a baseline of one, from depth.
pub(crate) fn rig_disparity(depth: &DepthMap, width: usize) -> DepthMap {
    let product = (RIG_FOCAL * RIG_BASELINE * width as f64) as f32;
    let data = depth.data().iter().map(|d| product / d).collect();
    map(depth.size(), data, Measure::Disparity)
}

fn map(size: (usize, usize), values: Vec<f32>, measure: Measure) -> DepthMap {
    DepthMap::new(size, values, 1.0, measure).expect("rays meet the wall")
}
