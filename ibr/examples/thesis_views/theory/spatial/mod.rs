//! Scenes of space: painted surfaces, pinhole cameras, and the bounds of chapter 4.
//!
//! A surface S(u, v) carries the texture T(u, v); every camera sees all of the part that is judged. The
//! propagated samples are triangulated (Delaunay), and intensity is linear on the triangles.

pub mod scenes;
#[cfg(test)]
mod tests;
mod theorem;
pub mod trial;
pub mod triangles;

pub use theorem::{EdgeModel, SpatialRig};

use hybank_ibr::camera::Camera;
use nalgebra::{Matrix2, Vector2, Vector3};

/// A point of a painted surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// S(u, v).
    pub point: Vector3<f64>,
    /// S_u and S_v.
    pub tangents: [Vector3<f64>; 2],
    /// T(u, v).
    pub texture: f64,
}

/// A surface with a texture.
pub trait PaintedSurface: Sync {
    /// The point of the parameters (u, v).
    fn at(&self, parameters: Vector2<f64>) -> SurfacePoint;
}

/// Pixel and depth of a surface point, and d(x, y) / d(u, v).
///
/// |det J| = |det M| |(S - C) . (S_u x S_v)| / d^3, six times the volume of the tetrahedron
/// S, S + S_u, S + S_v, C over d^3 (thesis A.3).
pub(crate) fn see(camera: &Camera, s: &SurfacePoint) -> (Vector2<f64>, f64, Matrix2<f64>) {
    let (x, y, d) = camera.project(&s.point);
    let column = |tangent: &Vector3<f64>| {
        let p = camera.m() * tangent;
        Vector2::new(p.x - x * p.z, p.y - y * p.z) / d
    };
    (Vector2::new(x, y), d, Matrix2::from_columns(&s.tangents.each_ref().map(column)))
}

/// The parameters at which a camera sees a pixel, by Newton's method from `start`; `None` if it does not
/// converge.
pub(crate) fn parameters_at(
    surface: &dyn PaintedSurface,
    camera: &Camera,
    pixel: Vector2<f64>,
    start: Vector2<f64>,
) -> Option<Vector2<f64>> {
    let mut at = start;
    for _ in 0..30 {
        let (seen, _, jacobian) = see(camera, &surface.at(at));
        let step = jacobian.try_inverse()? * (pixel - seen);
        at += step;
        if step.norm() < 1e-12 * (1.0 + at.norm()) {
            return Some(at);
        }
    }
    None
}

#[cfg(test)]
mod shape {
    use super::scenes::Hill;
    use super::*;
    use nalgebra::{Matrix3, Matrix3x4, Rotation3};

    fn camera() -> Camera {
        let k = Matrix3::new(300.0, 1.0, 10.0, 0.0, 310.0, 20.0, 0.0, 0.0, 1.0);
        let r = Rotation3::from_euler_angles(0.1, -0.2, 0.4);
        let mut rt = Matrix3x4::zeros();
        rt.fixed_columns_mut::<3>(0).copy_from(r.matrix());
        rt.set_column(3, &Vector3::new(0.2, -0.1, 0.3));
        Camera::metric(k * rt, false).unwrap()
    }

    #[test]
    fn the_jacobian_is_a_volume_and_a_derivative() {
        let (at, h) = (Vector2::new(0.4, -0.3), 1e-5);
        let s = Hill.at(at);
        let (_, d, j) = see(&camera(), &s);
        let volume = (s.point - camera().centre()).dot(&s.tangents[0].cross(&s.tangents[1]));
        let want = (camera().determinant() * volume / d.powi(3)).abs();
        assert!((j.determinant().abs() / want - 1.0).abs() < 1e-10);
        let pixel = |at: Vector2<f64>| see(&camera(), &Hill.at(at)).0;
        for (k, e) in [Vector2::x(), Vector2::y()].into_iter().enumerate() {
            let slope = (pixel(at + e * h) - pixel(at - e * h)) / (2.0 * h);
            assert!((slope - j.column(k)).norm() < 1e-5 * slope.norm());
        }
    }

    #[test]
    fn pixels_are_found_on_the_surface() {
        let at = Vector2::new(0.4, -0.3);
        let pixel = see(&camera(), &Hill.at(at)).0;
        let found = parameters_at(&Hill, &camera(), pixel, Vector2::zeros()).unwrap();
        assert!((found - at).norm() < 1e-9);
    }
}
