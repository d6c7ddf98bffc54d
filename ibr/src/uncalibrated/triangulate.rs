//! Points from their images in several cameras: linear, then Gauss-Newton on the reprojection error.

use super::Point;
use super::refine::reprojection;
use hybank_linalg::small;
use nalgebra::{Matrix3x4, Vector4};

const STEPS: usize = 2;

/// The homogeneous point, of unit norm, seen at `images` by `cameras`; `None` if it is not determined.
///
/// Each image gives the rows x pi3 - pi1 and y pi3 - pi2, scaled to unit norm; their null vector is refined
/// by two Gauss-Newton steps on the reprojection error.
pub fn triangulate(observed: &[(&Matrix3x4<f64>, Point)]) -> Option<Vector4<f64>> {
    let rows = observed.iter().flat_map(|(camera, p)| {
        let row = |k: usize, v: f64| {
            let r = camera.row(2) * v - camera.row(k);
            let norm = r.norm();
            [r[0] / norm, r[1] / norm, r[2] / norm, r[3] / norm]
        };
        [row(0, p.x), row(1, p.y)]
    });
    let (mut point, values) = small::least_vector(&rows.collect::<Vec<_>>())?;
    if values[2] <= 1e-12 * values[0] {
        return None;
    }
    for _ in 0..STEPS {
        point = refine(observed, &point).unwrap_or(point);
    }
    Some(point)
}

/// One Gauss-Newton step within the tangent space of the unit sphere.
fn refine(observed: &[(&Matrix3x4<f64>, Point)], point: &Vector4<f64>) -> Option<Vector4<f64>> {
    // The direction of the point itself is a gauge: pinned by one more row.
    let mut jtj = point * point.transpose();
    let mut jtr = Vector4::zeros();
    for (camera, p) in observed {
        let (residual, _, jacobian) = reprojection(camera, point, p);
        jtj += jacobian.transpose() * jacobian;
        jtr += jacobian.transpose() * residual;
    }
    let moved = point + jtj.cholesky()?.solve(&jtr);
    (total(observed, &moved) <= total(observed, point)).then(|| moved / moved.norm())
}

/// Sum of the squared errors; not a number for a point in a focal plane.
fn total(observed: &[(&Matrix3x4<f64>, Point)], point: &Vector4<f64>) -> f64 {
    let square = |(camera, p): &(&Matrix3x4<f64>, Point)| {
        let q = *camera * point;
        (q.xy() / q.z - p).norm_squared()
    };
    observed.iter().map(square).sum()
}

#[cfg(test)]
mod tests {
    use super::super::fundamental::tests::Synthetic;
    use super::*;

    #[test]
    fn points_come_back() {
        let scene = Synthetic::new(30, false);
        for (j, truth) in scene.points.iter().enumerate() {
            let seen = [(&scene.cameras[0], scene.image(0, j)), (&scene.cameras[1], scene.image(1, j))];
            let x = triangulate(&seen).unwrap();
            assert!((x.xyz() / x.w - truth).norm() < 1e-8, "{j}");
        }
    }

    #[test]
    fn refinement_lowers_the_reprojection_error() {
        let scene = Synthetic::new(30, false);
        for j in 0..30 {
            let off = Point::new(0.4 * ((j % 3) as f64 - 1.0), 0.3 * ((j % 5) as f64 - 2.0));
            let seen = [(&scene.cameras[0], scene.image(0, j) + off), (&scene.cameras[1], scene.image(1, j))];
            let x = triangulate(&seen).unwrap();
            // The undisturbed point itself misses by the displacement.
            assert!(total(&seen, &x) <= off.norm_squared() + 1e-6, "{j}");
        }
    }

    #[test]
    fn the_same_camera_twice_determines_nothing() {
        let scene = Synthetic::new(1, false);
        let seen = [(&scene.cameras[0], scene.image(0, 0)), (&scene.cameras[0], scene.image(0, 0))];
        assert_eq!(triangulate(&seen), None);
    }
}
