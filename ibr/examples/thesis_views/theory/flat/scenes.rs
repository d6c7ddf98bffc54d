//! Scenes and cameras of the virtual experiments in the plane.

use super::{CurvePoint, FlatCamera, PaintedCurve};
use nalgebra::Vector2;

/// A wave: S = (u, 5 + 0.3 cos 2u), T = 0.5 + 0.3 sin 6u + 0.15 cos(11 u + 1), |u| <= 1.9.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wave;

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

/// A straight piece at a constant distance with one sine on it: S = (u, distance), T = level + height
/// sin(rate u + phase).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// Y of all its points.
    pub distance: f64,
    /// X of its ends.
    pub ends: (f64, f64),
    /// Mean of its texture.
    pub level: f64,
    /// Amplitude of its texture.
    pub height: f64,
    /// Angular frequency of its texture per unit of u.
    pub rate: f64,
    /// Phase of its texture.
    pub phase: f64,
}

impl PaintedCurve for Board {
    fn range(&self) -> (f64, f64) {
        self.ends
    }

    fn at(&self, u: f64) -> CurvePoint {
        let (s, c) = (self.rate * u + self.phase).sin_cos();
        let (h, q) = (self.height, self.rate);
        CurvePoint {
            point: Vector2::new(u, self.distance),
            tangent: Vector2::new(1.0, 0.0),
            bend: Vector2::zeros(),
            texture: [self.level + h * s, h * q * c, -h * q * q * s],
        }
    }
}

/// A board half a unit to each side of the axis at distance 4, before one at distance 6.
pub fn board_before_wall() -> [Board; 2] {
    let half_turn = std::f64::consts::FRAC_PI_2;
    let wall = Board { distance: 6.0, ends: (-4.0, 4.0), level: 0.3, height: 0.1, rate: 2.0, phase: 0.0 };
    let board =
        Board { distance: 4.0, ends: (-0.5, 0.5), level: 0.8, height: 0.1, rate: 3.0, phase: half_turn };
    [wall, board]
}

/// N parallel cameras on the X axis from -1 to 1, not quite evenly, with `focal` pixels of focal length.
pub fn cameras(count: usize, focal: f64) -> Vec<FlatCamera> {
    let at = |i: f64| -1.0 + 2.0 * (i + 0.5) / count as f64 + 0.02 * (7.3 * i).sin();
    (0..count).map(|i| FlatCamera::looking([at(i as f64), 0.0], 0.0, focal)).collect()
}

/// The virtual camera of the experiments, at (0.137, 0).
pub fn virtual_camera(focal: f64) -> FlatCamera {
    FlatCamera::looking([0.137, 0.0], 0.0, focal)
}
