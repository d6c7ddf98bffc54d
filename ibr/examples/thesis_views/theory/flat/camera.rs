//! Cameras of the plane: 2 x 3 projections onto a line of pixels.

use super::CurvePoint;
use nalgebra::{Matrix2, Matrix2x3, Vector2};

/// A camera Pi = \[M | m\] of the plane, with d (x, 1)' = Pi (X, Y, 1)': x in pixels, d the depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlatCamera {
    matrix: Matrix2x3<f64>,
    inverse: Matrix2<f64>,
}

/// A curve as a camera sees it around one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// H(u), in pixels.
    pub x: f64,
    /// Depth.
    pub depth: f64,
    /// H'(u).
    pub first: f64,
    /// H''(u).
    pub second: f64,
}

impl FlatCamera {
    /// From a projection matrix, of any positive scale: points before the camera have a positive second
    /// coordinate (in the plane the sign of det M does not tell, as it does in space). Depth is Euclidean
    /// if the camera is rigid. `None` if M is singular or an entry is not finite.
    pub fn new(matrix: Matrix2x3<f64>) -> Option<Self> {
        let m: Matrix2<f64> = matrix.fixed_columns::<2>(0).into_owned();
        let scale = 1.0 / m.row(1).norm();
        let inverse = (m * scale).try_inverse()?;
        let finite = matrix.iter().all(|v| v.is_finite()) && scale.is_finite();
        finite.then_some(Self { matrix: matrix * scale, inverse })
    }

    /// A camera at `centre` that looks along +Y, turned to the left by `turn` radians, with a focal length
    /// in pixels; pixel 0 lies on its axis.
    pub fn looking(centre: [f64; 2], turn: f64, focal: f64) -> Self {
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
    pub fn determinant(&self) -> f64 {
        self.m().determinant()
    }

    /// The centre C = -M^{-1} m.
    pub fn centre(&self) -> Vector2<f64> {
        -self.inverse * self.matrix.column(2)
    }

    /// Pixel and depth of a point.
    pub fn project(&self, point: &Vector2<f64>) -> (f64, f64) {
        let p = self.matrix * point.push(1.0);
        (p.x / p.y, p.y)
    }

    /// The point at depth d on the ray of pixel x.
    pub fn unproject(&self, x: f64, d: f64) -> Vector2<f64> {
        self.inverse * (Vector2::new(x, 1.0) * d - self.matrix.column(2))
    }

    /// Largest change of the pixel per unit of displacement of a point: |m_1 - x m_2| / d.
    pub fn sensitivity(&self, point: &Vector2<f64>) -> f64 {
        let (x, d) = self.project(point);
        (self.m().row(0) - self.m().row(1) * x).norm() / d
    }

    /// H and its derivatives at a point of a curve, with p = Pi S~:
    ///
    /// ```text
    /// H' = n / d^2,   H'' = n' / d^2 - 2 n d' / d^3,   n = p_1' d - p_1 d'
    /// ```
    ///
    /// H' is det(M) (S' x (S - C)) / d^2, twice the area of the triangle S + S', S, C over d^2 (thesis A.1).
    pub fn see(&self, c: &CurvePoint) -> Projection {
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

#[cfg(test)]
mod tests {
    use super::super::scenes::Wave;
    use super::super::{PaintedCurve, cross};
    use super::*;

    #[test]
    fn slopes_are_areas_and_derivatives() {
        for camera in [
            FlatCamera::looking([0.3, -0.2], 0.2, 1.0),
            FlatCamera::new(Matrix2x3::new(-310.0, 20.0, 5.0, 0.1, -0.9, -0.3)).unwrap(),
        ] {
            for u in [-1.0, 0.1, 1.3] {
                let (c, h) = (Wave.at(u), 1e-4);
                let see = |u: f64| camera.see(&Wave.at(u));
                let (got, before, after) = (see(u), see(u - h), see(u + h));
                let area = cross(&c.tangent, &(c.point - camera.centre()));
                let want = camera.determinant() * area / (got.depth * got.depth);
                assert!((got.first / want - 1.0).abs() < 1e-10);
                assert!((got.first / ((after.x - before.x) / (2.0 * h)) - 1.0).abs() < 1e-6);
                assert!(
                    (got.second - (after.first - before.first) / (2.0 * h)).abs() < 1e-5 * got.first.abs()
                );
            }
        }
    }

    #[test]
    fn there_and_back() {
        let camera = FlatCamera::looking([0.3, -0.2], 0.2, 250.0);
        let general = FlatCamera::new(camera.matrix * 3.0).unwrap();
        assert!((general.matrix - camera.matrix).norm() < 1e-9);
        let p = camera.unproject(17.5, 4.0);
        let (x, d) = general.project(&p);
        assert!((x - 17.5).abs() < 1e-9 && (d - 4.0).abs() < 1e-12);
        assert!((camera.centre() - Vector2::new(0.3, -0.2)).norm() < 1e-12);
        assert_eq!(FlatCamera::new(Matrix2x3::zeros()), None);
    }
}
