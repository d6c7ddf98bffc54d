//! Linear interpolation on Delaunay triangles, and its sure bound (thesis Prop. 4.4).

use nalgebra::Vector2;
use spade::handles::FaceHandle;
use spade::{DelaunayTriangulation, HasPosition, Point2, PositionInTriangulation, Triangulation};

struct Vertex {
    position: Point2<f64>,
    value: f64,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// Samples of the plane, triangulated. Of samples at one position one is kept.
pub struct Triangles {
    mesh: DelaunayTriangulation<Vertex>,
}

/// A triangle around a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corners {
    /// Positions.
    pub points: [Vector2<f64>; 3],
    /// Values.
    pub values: [f64; 3],
}

impl Triangles {
    /// From positions and values; `None` if a position is beyond the range of the exact predicates.
    pub fn new(samples: impl IntoIterator<Item = (Vector2<f64>, f64)>) -> Option<Self> {
        let vertex = |(p, value): (Vector2<f64>, f64)| Vertex { position: Point2::new(p.x, p.y), value };
        let mesh = DelaunayTriangulation::bulk_load(samples.into_iter().map(vertex).collect()).ok()?;
        Some(Self { mesh })
    }

    /// The triangle around a position; `None` outside the hull.
    pub fn around(&self, at: Vector2<f64>) -> Option<Corners> {
        let at = Point2::new(at.x, at.y);
        let face = match self.mesh.locate(at) {
            PositionInTriangulation::OnFace(face) => self.mesh.face(face),
            PositionInTriangulation::OnEdge(edge) => self.mesh.directed_edge(edge).face().as_inner()?,
            PositionInTriangulation::OnVertex(vertex) => {
                self.mesh.vertex(vertex).out_edges().find_map(|edge| edge.face().as_inner())?
            }
            _ => return None,
        };
        Some(corners(face))
    }

    /// The interpolated value; `None` outside the hull.
    pub fn value(&self, at: Vector2<f64>) -> Option<f64> {
        let corners = self.around(at)?;
        let weights = corners.weights(at);
        Some(weights.iter().zip(corners.values).map(|(w, v)| w * v).sum())
    }

    /// All triangles.
    pub fn all(&self) -> impl Iterator<Item = Corners> {
        self.mesh.inner_faces().map(corners)
    }
}

fn corners(face: FaceHandle<'_, spade::handles::InnerTag, Vertex, (), (), ()>) -> Corners {
    let vertices = face.vertices();
    Corners {
        points: vertices.map(|v| Vector2::new(v.position().x, v.position().y)),
        values: vertices.map(|v| v.data().value),
    }
}

impl Corners {
    /// Area.
    pub fn area(&self) -> f64 {
        let [a, b, c] = self.points;
        (b - a).perp(&(c - a)).abs() / 2.0
    }

    /// Circumradius.
    pub fn radius(&self) -> f64 {
        let [a, b, c] = self.points;
        (b - a).norm() * (c - b).norm() * (a - c).norm() / (4.0 * self.area())
    }

    /// Barycentric coordinates of a position.
    pub fn weights(&self, at: Vector2<f64>) -> [f64; 3] {
        let [a, b, c] = self.points;
        let whole = (b - a).perp(&(c - a));
        let (v, w) = ((at - a).perp(&(c - a)) / whole, (b - a).perp(&(at - a)) / whole);
        [1.0 - v - w, v, w]
    }

    /// The sure bound of the error of linear interpolation at a position inside, for values that err by
    /// `error` and positions that err by `jitter` at most (Prop. 4.4 in its sharper form):
    ///
    /// ```text
    /// (1/2) K sum_k b_k |p_k - x|^2 + max|e| + |grad f| max|mu|
    /// ```
    ///
    /// The b_k are the barycentric coordinates; the sum is R^2 - |x - c|^2, at most R^2. K is the largest
    /// |eigenvalue| of the Hessian.
    pub fn error_bound(&self, at: Vector2<f64>, limits: PlaneSmoothness, error: f64, jitter: f64) -> f64 {
        let squares = self.weights(at).into_iter().zip(self.points).map(|(b, p)| b * (p - at).norm_squared());
        limits.curvature / 2.0 * squares.sum::<f64>() + error + limits.slope * jitter
    }
}

/// Suprema of the derivatives of a function of the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneSmoothness {
    /// sup |grad f|.
    pub slope: f64,
    /// K: sup of the largest |eigenvalue| of the Hessian.
    pub curvature: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::theory::random::{part, seeded, within};

    #[test]
    fn planes_are_reproduced_and_the_outside_has_no_value() {
        let f = |p: Vector2<f64>| 2.0 * p.x - 3.0 * p.y + 0.5;
        let mut random = seeded(1);
        let points: Vec<Vector2<f64>> =
            (0..200).map(|_| Vector2::new(part(&mut random), part(&mut random))).collect();
        let mesh = Triangles::new(points.iter().map(|p| (*p, f(*p)))).unwrap();
        for p in points.iter().take(50).chain(&[Vector2::new(0.5, 0.5), Vector2::new(0.31, 0.64)]) {
            let value = mesh.value(*p);
            assert!(value.is_none_or(|v| (v - f(*p)).abs() < 1e-9), "{p:?}");
        }
        assert!(mesh.value(Vector2::new(0.5, 0.5)).is_some() && mesh.value(Vector2::new(2.0, 0.0)).is_none());
    }

    /// Parabolas turned anyhow, triangles anyhow, errors of values and positions within their bounds: 10,000
    /// trials of Prop. 4.4.
    #[test]
    fn no_trial_exceeds_the_bound() {
        let (mut random, mut worst) = (seeded(4), 0.0_f64);
        for _ in 0..10_000 {
            let (a, b, c) = (within(1.0, &mut random), within(1.0, &mut random), within(1.0, &mut random));
            let f = |p: Vector2<f64>| a * p.x * p.x / 2.0 + b * p.x * p.y + c * p.y * p.y / 2.0;
            let (error, jitter) = (0.02 * part(&mut random), 0.02 * part(&mut random));
            let points: [Vector2<f64>; 3] =
                std::array::from_fn(|_| Vector2::new(part(&mut random), part(&mut random)));
            let values = points.map(|p| {
                let turn = 6.3 * part(&mut random);
                let moved = p + jitter * part(&mut random) * Vector2::new(turn.cos(), turn.sin());
                f(moved) + within(error, &mut random)
            });
            let corners = Corners { points, values };
            let (mut v, mut w) = (part(&mut random), part(&mut random));
            if v + w > 1.0 {
                (v, w) = (1.0 - v, 1.0 - w);
            }
            let at = points[0] + v * (points[1] - points[0]) + w * (points[2] - points[0]);
            let got: f64 = corners.weights(at).iter().zip(values).map(|(b, v)| b * v).sum();
            // Eigenvalues of [[a, b], [b, c]]; the gradient on the unit square and a little around it.
            let spread = ((a - c) * (a - c) / 4.0 + b * b).sqrt();
            let curvature = ((a + c) / 2.0).abs() + spread;
            let limits = PlaneSmoothness { slope: curvature * 1.5, curvature };
            let (miss, bound) = ((got - f(at)).abs(), corners.error_bound(at, limits, error, jitter));
            assert!(miss <= bound * (1.0 + 1e-9) + 1e-12, "{miss} {bound} {corners:?}");
            assert!(
                bound <= curvature / 2.0 * corners.radius().powi(2) + error + limits.slope * jitter + 1e-9
            );
            worst = worst.max(miss / bound);
        }
        assert!(worst > 0.8, "the bound is loose: {worst}");
    }
}
