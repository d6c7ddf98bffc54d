//! Scenes of the plane: painted curves, cameras with one row of pixels, and the bounds of chapter 3.
//!
//! A curve S(u) carries the texture T(u). Camera i sees it through H_i(u), which is monotone: nothing is
//! hidden. All cameras count in pixels, so cameras of different resolution
//! differ in their focal lengths.

mod camera;
pub(crate) mod scenes;
mod theorem;
pub(crate) mod trial;

pub(crate) use camera::FlatCamera;
pub(crate) use theorem::{ErrorBound, Errors, FlatRig, UNIFORM_ERROR_SHARE};

use nalgebra::Vector2;

/// A point of a painted curve with its derivatives by u.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CurvePoint {
    /// S(u).
    pub(crate) point: Vector2<f64>,
    /// S'(u).
    pub(crate) tangent: Vector2<f64>,
    /// S''(u).
    pub(crate) bend: Vector2<f64>,
    /// T, T' and T''.
    pub(crate) texture: [f64; 3],
}

/// A curve with a texture.
pub(crate) trait PaintedCurve: Sync {
    /// The parameters of its ends.
    fn range(&self) -> (f64, f64);
    /// The point of parameter u.
    fn at(&self, u: f64) -> CurvePoint;
}

/// a_X b_Y - a_Y b_X: twice the area of the triangle 0, a, b, with sign.
pub(crate) fn cross(a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    a.x * b.y - a.y * b.x
}

/// The parameter at which a camera sees pixel x; the nearer end if the curve ends before.
///
/// Newton's method within a bracket that is halved where a step leaves it.
pub(crate) fn parameter_at(curve: &dyn PaintedCurve, camera: &FlatCamera, x: f64) -> f64 {
    let (mut low, mut high) = curve.range();
    let see = |u: f64| camera.see(&curve.at(u));
    let rising = see(high).x > see(low).x;
    let mut u = (low + high) / 2.0;
    for _ in 0..60 {
        let seen = see(u);
        let step = (x - seen.x) / seen.first;
        if step.abs() < 1e-13 * (1.0 + u.abs()) {
            break;
        }
        if (seen.x < x) == rising {
            low = u;
        } else {
            high = u;
        }
        let next = u + step;
        u = if next > low && next < high { next } else { (low + high) / 2.0 };
    }
    u
}
