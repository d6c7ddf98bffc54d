//! Scene and cameras of the virtual experiments in space.

use super::{PaintedSurface, SurfacePoint};
use hybank_ibr::camera::{Camera, CameraError};
use nalgebra::{Matrix3x4, Vector2, Vector3};

/// A hill: S = (u, v, 6 + 0.3 cos 1.3u cos 1.1v), T = 0.5 + 0.25 sin(4u + 1) cos 3v + 0.15 sin(2u - 5v).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Hill;

impl PaintedSurface for Hill {
    fn at(&self, p: Vector2<f64>) -> SurfacePoint {
        let ((su, cu), (sv, cv)) = ((1.3 * p.x).sin_cos(), (1.1 * p.y).sin_cos());
        let paint = 0.25 * (4.0 * p.x + 1.0).sin() * (3.0 * p.y).cos() + 0.15 * (2.0 * p.x - 5.0 * p.y).sin();
        SurfacePoint {
            point: Vector3::new(p.x, p.y, 6.0 + 0.3 * cu * cv),
            tangents: [Vector3::new(1.0, 0.0, -0.39 * su * cv), Vector3::new(0.0, 1.0, -0.33 * cu * sv)],
            texture: 0.5 + paint,
        }
    }
}

/// A camera in the plane Z = 0 that looks along +Z, with `focal` pixels of focal length; pixel (0, 0) lies
/// on its axis.
///
/// # Errors
/// [`CameraError`] for numbers that are not finite or a focal length of 0.
pub(crate) fn camera_at(x: f64, y: f64, focal: f64) -> Result<Camera, CameraError> {
    let f = focal;
    Camera::metric(Matrix3x4::new(f, 0.0, 0.0, -f * x, 0.0, f, 0.0, -f * y, 0.0, 0.0, 1.0, 0.0), false)
}
