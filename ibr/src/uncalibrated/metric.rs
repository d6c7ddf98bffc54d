//! A metric guess: a calibration with the principal point at the image centre and a guessed focal length.
//!
//! It is too coarse for measurements, but sufficient to place a virtual camera between two views.

use super::{Match, Point, homogeneous};
use hybank_linalg::small;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Focal lengths that are tried, in units of the longer side of the image.
pub(super) const FOCAL_LENGTHS: [f64; 9] = [0.5, 0.62, 0.76, 0.93, 1.14, 1.39, 1.7, 2.08, 2.5];

/// A guessed metric pair: camera 1 at the origin, camera 2 turned by R and moved by t of length one.
#[derive(Debug, Clone, PartialEq)]
pub struct MetricGuess {
    /// Calibrations of the two cameras.
    pub k: [Matrix3<f64>; 2],
    /// Rotation of camera 2.
    pub r: Rotation3<f64>,
    /// Translation of camera 2.
    pub t: Vector3<f64>,
    /// Second over first singular value of the essential matrix: 1 if the guess fits F exactly.
    pub fit: f64,
    /// The points, camera 1 coordinates, `None` where they are not in front of both cameras.
    pub points: Vec<Option<Vector3<f64>>>,
}

/// Calibration with the principal point in the middle.
pub(super) fn calibration(focal: f64, (width, height): (usize, usize)) -> Matrix3<f64> {
    let (cx, cy) = ((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0);
    Matrix3::new(focal, 0.0, cx, 0.0, focal, cy, 0.0, 0.0, 1.0)
}

/// The second camera beside the first one, by E = K2^T F K1 = \[t\]_x R: of its two R and the signs of t
/// those with which most points lie in front of both cameras.
pub(super) struct Placed {
    r: Matrix3<f64>,
    t: Vector3<f64>,
    /// Second over first singular value of E.
    pub(super) fit: f64,
    /// Rays of the points in the first camera, of depth one.
    pub(super) rays: Vec<Vector3<f64>>,
    /// 1 / depth in the first camera, `None` for points that do not lie in front of both.
    pub(super) near: Vec<Option<f64>>,
}

impl Placed {
    pub(super) fn of(f: &Matrix3<f64>, matches: &[Match], k: &[Matrix3<f64>; 2]) -> Option<Self> {
        let (u, s, v) = small::svd3(&(k[1].transpose() * f * k[0]))?;
        let (u, v) = (u * u.determinant().signum(), v * v.determinant().signum());
        let w = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        let (first, second) = (k[0].try_inverse()?, k[1].try_inverse()?);
        let ray = |m: &Match| [first * homogeneous(&m.first), second * homogeneous(&m.second)];
        let rays: Vec<[Vector3<f64>; 2]> = matches.iter().map(ray).collect();
        let t = u.column(2).into_owned();
        let placed = |w: Matrix3<f64>| {
            let r = u * w * v.transpose();
            let (side, near) = in_front(&rays, &r, &t);
            (near.iter().flatten().count(), r, side, near)
        };
        let (one, other) = (placed(w), placed(w.transpose()));
        let (_, r, side, near) = if one.0 >= other.0 { one } else { other };
        let rays = rays.iter().map(|[ray, _]| *ray).collect();
        Some(Self { r, t: t * side, fit: s[1] / s[0], rays, near })
    }
}

/// The sign of t with which most points lie in front of both cameras, and their 1 / depth in the first.
///
/// z2 b = z1 R a + t for the rays a and b gives z1 = -(b x t) . (b x R a) / |b x R a|^2, and z2 likewise.
fn in_front(rays: &[[Vector3<f64>; 2]], r: &Matrix3<f64>, t: &Vector3<f64>) -> (f64, Vec<Option<f64>>) {
    let depths = |[a, b]: &[Vector3<f64>; 2]| {
        let turned = r * a;
        let across = b.cross(&turned);
        [-b.cross(t), -turned.cross(t)].map(|side| side.dot(&across) / across.norm_squared())
    };
    let all: Vec<[f64; 2]> = rays.iter().map(depths).collect();
    let is_in_front = |z: &[f64; 2], side: f64| z.iter().all(|z| z * side > 0.0 && z.is_finite());
    let count = |side| all.iter().filter(|z| is_in_front(z, side)).count();
    let side = if count(1.0) >= count(-1.0) { 1.0 } else { -1.0 };
    (side, all.iter().map(|z| is_in_front(z, side).then(|| side / z[0])).collect())
}

/// The guess for one focal length.
pub fn guess(
    f: &Matrix3<f64>,
    matches: &[Match],
    sizes: [(usize, usize); 2],
    focal: f64,
) -> Option<MetricGuess> {
    let k = sizes.map(|size| calibration(focal, size));
    let Placed { r, t, fit, rays, near } = Placed::of(f, matches, &k)?;
    let points = rays.iter().zip(near).map(|(ray, near)| Some(ray / near?)).collect();
    Some(MetricGuess { k, r: Rotation3::from_matrix_unchecked(r), t, fit, points })
}

/// The guess with the focal length that fits F best.
pub fn best(f: &Matrix3<f64>, matches: &[Match], sizes: [(usize, usize); 2]) -> Option<MetricGuess> {
    let side = sizes.iter().map(|s| s.0.max(s.1)).max().unwrap_or(1) as f64;
    let guesses = FOCAL_LENGTHS.iter().filter_map(|factor| guess(f, matches, sizes, factor * side));
    guesses.max_by(|a, b| a.fit.total_cmp(&b.fit))
}

/// The image points of the matches behind `guess` in a camera between the two views. Rotation and centre
/// are interpolated, and the residuals of the guess in the two views are blended in, so that `between` = 0
/// and 1 reproduce the views exactly.
pub fn images_between(guess: &MetricGuess, matches: &[Match], between: f64) -> Vec<Option<Point>> {
    let turn = UnitQuaternion::from_rotation_matrix(&guess.r);
    let r = UnitQuaternion::identity().slerp(&turn, between);
    let centre = -(guess.r.inverse() * guess.t) * between;
    let k = guess.k[0] * (1.0 - between) + guess.k[1] * between;
    let project = |k: &Matrix3<f64>, p: Vector3<f64>| {
        let q = k * p;
        (q.z > 0.0).then(|| q.xy() / q.z)
    };
    let image = |(point, m): (&Option<Vector3<f64>>, &Match)| {
        let p = (*point)?;
        let missed_first = m.first - project(&guess.k[0], p)?;
        let missed_second = m.second - project(&guess.k[1], guess.r * p + guess.t)?;
        let there = project(&k, r * (p - centre))?;
        Some(there + missed_first * (1.0 - between) + missed_second * between)
    };
    guess.points.iter().zip(matches).map(image).collect()
}

#[cfg(test)]
mod tests {
    use super::super::fundamental::eight_point;
    use super::super::fundamental::tests::Synthetic;
    use super::*;

    const SIZES: [(usize, usize); 2] = [(641, 481); 2];

    #[test]
    fn the_right_focal_length_gives_the_scene() {
        let scene = Synthetic::new(50, false);
        let matches = scene.matches();
        let g = guess(&eight_point(&matches).unwrap(), &matches, SIZES, 800.0).unwrap();
        assert!((g.fit - 1.0).abs() < 1e-6, "{}", g.fit);
        // Depths agree with the true ones up to one factor.
        let ratio = |j: usize| g.points[j].unwrap().z / (scene.cameras[0] * scene.points[j].push(1.0)).z;
        assert!((0..50).all(|j| (ratio(j) / ratio(0) - 1.0).abs() < 1e-5));
    }

    #[test]
    fn the_ends_of_the_way_are_the_views() {
        let scene = Synthetic::new(50, false);
        let matches = scene.matches();
        let found = best(&eight_point(&matches).unwrap(), &matches, SIZES).unwrap();
        let [start, middle, end] = [0.0, 0.5, 1.0].map(|at| images_between(&found, &matches, at));
        for (j, m) in matches.iter().enumerate() {
            assert!((start[j].unwrap() - m.first).norm() < 1e-9);
            assert!((end[j].unwrap() - m.second).norm() < 1e-9);
            let way = (m.first + m.second) / 2.0;
            assert!((middle[j].unwrap() - way).norm() < 60.0);
        }
    }
}
