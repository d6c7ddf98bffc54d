//! A metric guess: a calibration with the principal point at the image centre and a guessed focal length.
//!
//! It is too coarse for measurements, but sufficient to place a virtual camera between two views.

use super::triangulate::triangulate;
use super::{Match, Point, homogeneous};
use crate::linear;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, UnitQuaternion, Vector3};

/// Focal lengths that are tried, in units of the longer side of the image.
pub(super) const FOCAL_LENGTHS: [f64; 9] = [0.5, 0.62, 0.76, 0.93, 1.14, 1.39, 1.7, 2.08, 2.5];

/// A guessed metric pair: camera 1 at the origin, camera 2 turned by R and moved by t of length one.
#[derive(Debug, Clone, PartialEq)]
pub struct MetricGuess {
    /// Focal length in pixels, the same for both cameras.
    pub focal: f64,
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

/// What E = K2^T F K1 says of the second camera, up to the sign of t and the choice of the rotation.
pub(super) struct Essential {
    pub(super) rotations: [Matrix3<f64>; 2],
    pub(super) t: Vector3<f64>,
    /// Second over first singular value.
    pub(super) fit: f64,
}

impl Essential {
    pub(super) fn of(f: &Matrix3<f64>, k: &[Matrix3<f64>; 2]) -> Option<Self> {
        let (u, s, v) = linear::svd3(&(k[1].transpose() * f * k[0]))?;
        let (u, v) = (u * u.determinant().signum(), v * v.determinant().signum());
        let w = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        let rotations = [u * w * v.transpose(), u * w.transpose() * v.transpose()];
        Some(Self { rotations, t: u.column(2).into_owned(), fit: s[1] / s[0] })
    }
}

/// The guess for one focal length: E = K2^T F K1, the decomposition with most points in front of both
/// cameras.
pub fn guess(
    f: &Matrix3<f64>,
    matches: &[Match],
    sizes: [(usize, usize); 2],
    focal: f64,
) -> Option<MetricGuess> {
    let k = sizes.map(|size| calibration(focal, size));
    let Essential { rotations, t, fit } = Essential::of(f, &k)?;
    let inverse = [k[0].try_inverse()?, k[1].try_inverse()?];
    let rays: Vec<[Point; 2]> = matches
        .iter()
        .map(|m| {
            let ray = |k: &Matrix3<f64>, p: &Point| (k * homogeneous(p)).xy();
            [ray(&inverse[0], &m.first), ray(&inverse[1], &m.second)]
        })
        .collect();
    let candidates = rotations.iter().flat_map(|r| [(r, t), (r, -t)]);
    let best = candidates
        .map(|(r, t)| (r, t, in_front(&rays, r, &t)))
        .max_by_key(|(_, _, points)| points.iter().flatten().count())?;
    let r = Rotation3::from_matrix_unchecked(*best.0);
    Some(MetricGuess { focal, k, r, t: best.1, fit, points: best.2 })
}

/// The points in camera 1 coordinates, where they lie in front of both cameras.
fn in_front(rays: &[[Point; 2]], r: &Matrix3<f64>, t: &Vector3<f64>) -> Vec<Option<Vector3<f64>>> {
    let one = Matrix3x4::identity();
    let mut two = Matrix3x4::zeros();
    two.fixed_columns_mut::<3>(0).copy_from(r);
    two.set_column(3, t);
    let point = |rays: &[Point; 2]| {
        let p = triangulate(&[(&one, rays[0]), (&two, rays[1])])?;
        let p = p.xyz() / p.w;
        (p.z > 0.0 && (r * p + t).z > 0.0 && p.z.is_finite()).then_some(p)
    };
    rays.iter().map(point).collect()
}

/// The guess with the focal length that fits F best.
pub fn best(f: &Matrix3<f64>, matches: &[Match], sizes: [(usize, usize); 2]) -> Option<MetricGuess> {
    let side = sizes.iter().map(|s| s.0.max(s.1)).max().unwrap_or(1) as f64;
    let fits = FOCAL_LENGTHS.iter().filter_map(|factor| {
        let focal = factor * side;
        Some((focal, Essential::of(f, &sizes.map(|size| calibration(focal, size)))?.fit))
    });
    let (focal, _) = fits.max_by(|a, b| a.1.total_cmp(&b.1))?;
    guess(f, matches, sizes, focal)
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
