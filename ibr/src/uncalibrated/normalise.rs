//! Hartley's normalisation: centroid to the origin, mean distance to sqrt 2.

use super::Point;
use nalgebra::Matrix3;

/// The similarity that normalises a set of points, as scale and centroid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normalisation {
    centroid: Point,
    scale: f64,
}

impl Normalisation {
    /// The normalisation of the points; that of coinciding points only shifts.
    pub fn of<'a>(points: impl Iterator<Item = &'a Point> + Clone) -> Self {
        let count = points.clone().count().max(1) as f64;
        let centroid = points.clone().sum::<Point>() / count;
        let spread = points.map(|p| (p - centroid).norm()).sum::<f64>() / count;
        let scale = if spread > 0.0 { std::f64::consts::SQRT_2 / spread } else { 1.0 };
        Self { centroid, scale }
    }

    /// A pixel in normalised coordinates.
    pub fn apply(&self, p: &Point) -> Point {
        (p - self.centroid) * self.scale
    }

    /// T with T x~ the normalised point; its third row is (0, 0, 1), so that third coordinates, and with
    /// them depth and chi, are the same in both coordinates.
    pub fn matrix(&self) -> Matrix3<f64> {
        let (s, c) = (self.scale, self.centroid);
        Matrix3::new(s, 0.0, -s * c.x, 0.0, s, -s * c.y, 0.0, 0.0, 1.0)
    }

    /// T^{-1}.
    pub fn inverse(&self) -> Matrix3<f64> {
        let (s, c) = (1.0 / self.scale, self.centroid);
        Matrix3::new(s, 0.0, c.x, 0.0, s, c.y, 0.0, 0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centred_and_scaled() {
        let points = [Point::new(100.0, 7.0), Point::new(400.0, 90.0), Point::new(30.0, 500.0)];
        let t = Normalisation::of(points.iter());
        let moved: Vec<Point> = points.iter().map(|p| t.apply(p)).collect();
        assert!(moved.iter().sum::<Point>().norm() < 1e-12);
        let mean = moved.iter().map(|p| p.norm()).sum::<f64>() / 3.0;
        assert!((mean - std::f64::consts::SQRT_2).abs() < 1e-12);
        assert!((t.matrix() * t.inverse() - Matrix3::identity()).norm() < 1e-12);
        let p = t.matrix() * points[1].push(1.0);
        assert!((p.xy() - moved[1]).norm() < 1e-12 && p.z == 1.0);
    }

    #[test]
    fn coinciding_points_do_not_divide_by_zero() {
        let points = [Point::new(3.0, 4.0); 5];
        assert_eq!(Normalisation::of(points.iter()).scale, 1.0);
    }
}
