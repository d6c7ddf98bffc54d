//! Cameras of the plane: 2 x 3 projections onto a line of pixels.

use super::CurvePoint;
use nalgebra::{Matrix2, Matrix2x3, Vector2};

/// A camera Pi = \[M | m\] of the plane, with d (x, 1)' = Pi (X, Y, 1)': x in pixels, d the depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FlatCamera {
    matrix: Matrix2x3<f64>,
    inverse: Matrix2<f64>,
}

/// A curve as a camera sees it around one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Projection {
    /// H(u), in pixels.
    pub(crate) x: f64,
    /// Depth.
    pub(crate) depth: f64,
    /// H'(u).
    pub(crate) first: f64,
    /// H''(u).
    pub(crate) second: f64,
}

impl FlatCamera {
    /// A camera at `centre` that looks along +Y, turned to the left by `turn` radians, with a focal length
    /// in pixels; pixel 0 lies on its axis.
    pub(crate) fn looking(centre: [f64; 2], turn: f64, focal: f64) -> Self {
        let (s, c) = turn.sin_cos();
        let m = Matrix2::new(focal * c, focal * s, -s, c);
        let t = -m * Vector2::from(centre);
        let inverse = Matrix2::new(c / focal, -s, s / focal, c);
        Self { matrix: Matrix2x3::new(m[(0, 0)], m[(0, 1)], t.x, m[(1, 0)], m[(1, 1)], t.y), inverse }
    }

    fn m(&self) -> Matrix2<f64> {
        self.matrix.fixed_columns::<2>(0).into_owned()
    }

    /// det M.
    pub(crate) fn determinant(&self) -> f64 {
        self.m().determinant()
    }

    /// The centre C = -M^{-1} m.
    pub(crate) fn centre(&self) -> Vector2<f64> {
        -self.inverse * self.matrix.column(2)
    }

    /// Pixel and depth of a point.
    pub(crate) fn project(&self, point: &Vector2<f64>) -> (f64, f64) {
        let p = self.matrix * point.push(1.0);
        (p.x / p.y, p.y)
    }

    /// The point at depth d on the ray of pixel x.
    pub(crate) fn unproject(&self, x: f64, d: f64) -> Vector2<f64> {
        self.inverse * (Vector2::new(x, 1.0) * d - self.matrix.column(2))
    }

    /// H and its derivatives at a point of a curve, with p = Pi S~:
    ///
    /// ```text
    /// H' = n / d^2,   H'' = n' / d^2 - 2 n d' / d^3,   n = p_1' d - p_1 d'
    /// ```
    ///
    /// H' is det(M) (S' x (S - C)) / d^2, twice the area of the triangle S + S', S, C over d^2 (thesis A.1).
    pub(crate) fn see(&self, c: &CurvePoint) -> Projection {
        let p = self.matrix * c.point.push(1.0);
        let (first, second) = (self.m() * c.tangent, self.m() * c.bend);
        let n = first.x * p.y - p.x * first.y;
        let slope = second.x * p.y - p.x * second.y;
        let d2 = p.y * p.y;
        Projection {
            x: p.x / p.y,
            depth: p.y,
            first: n / d2,
            second: slope / d2 - 2.0 * n * first.y / (d2 * p.y),
        }
    }
}
