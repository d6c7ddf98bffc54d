//! Scenes and cameras of the virtual experiments in the plane.

use super::{CurvePoint, FlatCamera, PaintedCurve};
use nalgebra::Vector2;

/// A wave: S = (u, 5 + 0.3 cos 2u), T = 0.5 + 0.3 sin 6u + 0.15 cos(11 u + 1), |u| <= 1.9.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Wave;

impl PaintedCurve for Wave {
    fn range(&self) -> (f64, f64) {
        (-1.9, 1.9)
    }

    fn at(&self, u: f64) -> CurvePoint {
        let (s, c) = (2.0 * u).sin_cos();
        let ((s6, c6), (s11, c11)) = ((6.0 * u).sin_cos(), (11.0 * u + 1.0).sin_cos());
        CurvePoint {
            point: Vector2::new(u, 5.0 + 0.3 * c),
            tangent: Vector2::new(1.0, -0.6 * s),
            bend: Vector2::new(0.0, -1.2 * c),
            texture: [0.5 + 0.3 * s6 + 0.15 * c11, 1.8 * c6 - 1.65 * s11, -10.8 * s6 - 18.15 * c11],
        }
    }
}

/// N parallel cameras on the X axis from -1 to 1, not quite evenly, with `focal` pixels of focal length.
pub(crate) fn cameras(count: usize, focal: f64) -> Vec<FlatCamera> {
    let at = |i: f64| -1.0 + 2.0 * (i + 0.5) / count as f64 + 0.02 * (7.3 * i).sin();
    (0..count).map(|i| FlatCamera::looking([at(i as f64), 0.0], 0.0, focal)).collect()
}

/// The virtual camera of the experiments, at (0.137, 0).
pub(crate) fn virtual_camera(focal: f64) -> FlatCamera {
    FlatCamera::looking([0.137, 0.0], 0.0, focal)
}
