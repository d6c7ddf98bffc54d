//! A camera from points and their images: DLT on six, RANSAC, refinement of the reprojection error.

use super::normalise::Normalisation;
use super::random::consensus;
use super::refine::{descend, reprojection};
use super::{GeometryError, Point};
use hybank_linalg::small;
use nalgebra::{Matrix3x4, SVector, Vector4};

/// A homogeneous point and its image in the camera to be found, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// The point in the projective frame.
    pub point: Vector4<f64>,
    /// Its image.
    pub image: Point,
}

/// A resected camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Resection {
    /// The camera, in pixels, of unit norm.
    pub camera: Matrix3x4<f64>,
    /// Indices of the sightings within the threshold.
    pub inliers: Vec<usize>,
    /// Root mean square reprojection error of the inliers in pixels.
    pub rms: f64,
}

const NEEDED: usize = 6;
/// Below this ratio of singular values the sightings do not determine the camera, for example points on a
/// plane.
const DEGENERATE: f64 = 1e-9;

/// Reprojection error below which a sighting is an inlier, in pixels.
pub(crate) const REPROJECTION: f64 = 2.0;

/// Estimates the camera from points and their images; the same seed gives the same bits.
///
/// # Errors
/// [`GeometryError`]: fewer than 6 sightings or inliers, points that leave the camera undetermined.
pub fn resect(sightings: &[Sighting], seed: u64) -> Result<Resection, GeometryError> {
    let what = "matches of known points in the virtual view";
    if sightings.len() < NEEDED {
        return Err(GeometryError::TooFew { what, found: sightings.len(), needed: NEEDED });
    }
    let threshold = REPROJECTION;
    let mut set = consensus::<NEEDED>(sightings.len(), seed, |sample| {
        Some(inliers(&direct(&sample.map(|i| sightings[i])).ok()?, sightings, threshold))
    });
    let mut camera = Matrix3x4::zeros();
    for _ in 0..5 {
        if set.len() < NEEDED {
            let (what, inliers, matches) = ("virtual camera", set.len(), sightings.len());
            return Err(GeometryError::NoConsensus { what, inliers, matches, threshold });
        }
        let chosen: Vec<Sighting> = set.iter().map(|i| sightings[*i]).collect();
        camera = refined(&direct(&chosen)?, &chosen);
        let next = inliers(&camera, sightings, threshold);
        if next == set {
            break;
        }
        set = next;
    }
    let squares: f64 = set.iter().map(|i| error(&camera, &sightings[*i])).sum();
    let rms = (squares / set.len().max(1) as f64).sqrt();
    Ok(Resection { camera: camera / camera.norm(), inliers: set, rms })
}

fn error(camera: &Matrix3x4<f64>, s: &Sighting) -> f64 {
    let p = camera * s.point;
    let square = (p.xy() / p.z - s.image).norm_squared();
    if square.is_finite() { square } else { f64::INFINITY }
}

fn inliers(camera: &Matrix3x4<f64>, sightings: &[Sighting], threshold: f64) -> Vec<usize> {
    (0..sightings.len()).filter(|i| error(camera, &sightings[*i]) < threshold * threshold).collect()
}

/// The camera of least algebraic error, with normalised images and points of unit norm.
fn direct(sightings: &[Sighting]) -> Result<Matrix3x4<f64>, GeometryError> {
    let what = "virtual camera";
    let t = Normalisation::of(sightings.iter().map(|s| &s.image));
    let rows: Vec<[f64; 12]> = sightings
        .iter()
        .flat_map(|s| {
            let (p, x) = (t.apply(&s.image), s.point / s.point.norm());
            let row = |first: usize, v: f64| {
                std::array::from_fn(|k| match k {
                    8.. => -v * x[k - 8],
                    _ if k / 4 == first => x[k % 4],
                    _ => 0.0,
                })
            };
            [row(0, p.x), row(1, p.y)]
        })
        .collect();
    let (p, values) = small::least_vector(&rows).ok_or(GeometryError::Numerical { what })?;
    let ratio = values[10] / values[0];
    if ratio < DEGENERATE {
        return Err(GeometryError::Degenerate { what, ratio });
    }
    Ok(t.inverse() * Matrix3x4::from_row_slice(p.as_slice()))
}

/// The camera of least reprojection error in the normalised image; never worse than the start.
fn refined(start: &Matrix3x4<f64>, sightings: &[Sighting]) -> Matrix3x4<f64> {
    let t = Normalisation::of(sightings.iter().map(|s| &s.image));
    let normal: Vec<Sighting> = sightings
        .iter()
        .map(|s| Sighting { point: s.point / s.point.norm(), image: t.apply(&s.image) })
        .collect();
    let mean = |c: &Matrix3x4<f64>| normal.iter().map(|s| error(c, s)).sum::<f64>() / normal.len() as f64;
    let moved = |c: &Matrix3x4<f64>, damping| {
        let moved = c + Matrix3x4::from_row_slice(step(c, &normal, damping)?.as_slice());
        Some(moved / moved.norm())
    };
    let found = descend((t.matrix() * start).normalize(), |c| Some(mean(c)), moved);
    found.map_or(*start, |(camera, _)| t.inverse() * camera)
}

/// One damped step; the camera's own direction, a gauge, is pinned.
fn step(camera: &Matrix3x4<f64>, sightings: &[Sighting], damping: f64) -> Option<SVector<f64, 12>> {
    let own = SVector::<f64, 12>::from_fn(|k, _| camera[(k / 4, k % 4)]);
    let (mut jtj, mut jtr) = (own * own.transpose(), SVector::<f64, 12>::zeros());
    for s in sightings {
        let (residual, jacobian, _) = reprojection(camera, &s.point, &s.image);
        jtj += jacobian.transpose() * jacobian;
        jtr += jacobian.transpose() * residual;
    }
    let diagonal = jtj.diagonal();
    (0..12).for_each(|k| jtj[(k, k)] += damping * diagonal[k]);
    Some(jtj.cholesky()?.solve(&jtr))
}

#[cfg(test)]
mod tests {
    use super::super::fundamental::tests::Synthetic;
    use super::*;
    use nalgebra::Matrix4;

    fn sightings(scene: &Synthetic, h: &Matrix4<f64>) -> Vec<Sighting> {
        (0..scene.points.len())
            .map(|j| Sighting { point: h * scene.points[j].push(1.0), image: scene.image(2, j) })
            .collect()
    }

    fn projective() -> Matrix4<f64> {
        Matrix4::new(1.0, 0.2, -0.1, 0.3, 0.0, 0.9, 0.3, -0.2, 0.1, -0.3, 1.2, 0.4, 0.05, -0.02, 0.1, 0.8)
    }

    #[test]
    fn the_camera_comes_back_in_any_frame() {
        let scene = Synthetic::new(40, false);
        let h = projective();
        let found = resect(&sightings(&scene, &h), 1).unwrap();
        assert_eq!(found.inliers.len(), 40);
        assert!(found.rms < 1e-6, "{}", found.rms);
        let want = scene.cameras[2] * h.try_inverse().unwrap();
        let want = want / want.norm();
        let sign = want.dot(&found.camera).signum();
        assert!((found.camera * sign - want).norm() < 1e-8);
    }

    #[test]
    fn outliers_do_not_move_it_and_noise_little() {
        let scene = Synthetic::new(60, false);
        let mut seen = sightings(&scene, &projective());
        for (i, s) in seen.iter_mut().enumerate() {
            let noise = Point::new(((i * 7) % 5) as f64 - 2.0, ((i * 3) % 5) as f64 - 2.0) * 0.1;
            s.image += if i % 4 == 0 { Point::new(40.0, -25.0) } else { noise };
        }
        let found = resect(&seen, 1).unwrap();
        assert_eq!(found.inliers.len(), 45);
        assert!(found.rms < 0.25, "{}", found.rms);
    }

    #[test]
    fn five_points_and_planes_are_not_enough() {
        let few = sightings(&Synthetic::new(5, false), &projective());
        assert!(matches!(resect(&few, 1), Err(GeometryError::TooFew { found: 5, needed: 6, .. })));
        let flat = sightings(&Synthetic::new(40, true), &projective());
        assert!(resect(&flat, 1).is_err());
    }
}
