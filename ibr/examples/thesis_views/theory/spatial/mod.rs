//! Scenes of space: painted surfaces, pinhole cameras, and the bounds of chapter 4.
//!
//! A surface S(u, v) carries the texture T(u, v); every camera sees all of the part that is judged. The
//! propagated samples are triangulated (Delaunay), and intensity is linear on the triangles.

pub(crate) mod scenes;
mod theorem;
pub(crate) mod trial;
pub(crate) mod triangles;

pub(crate) use theorem::SpatialRig;

use hybank_ibr::camera::Camera;
use nalgebra::{Matrix2, Vector2, Vector3};

/// A point of a painted surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfacePoint {
    /// S(u, v).
    pub(crate) point: Vector3<f64>,
    /// S_u and S_v.
    pub(crate) tangents: [Vector3<f64>; 2],
    /// T(u, v).
    pub(crate) texture: f64,
}

/// A surface with a texture.
pub(crate) trait PaintedSurface: Sync {
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
