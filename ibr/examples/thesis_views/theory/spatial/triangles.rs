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
pub(crate) struct Triangles {
    mesh: DelaunayTriangulation<Vertex>,
}

/// A triangle around a position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Corners {
    /// Positions.
    pub(crate) points: [Vector2<f64>; 3],
    /// Values.
    pub(crate) values: [f64; 3],
}

impl Triangles {
    /// From positions and values; `None` if a position is beyond the range of the exact predicates.
    pub(crate) fn new(samples: impl IntoIterator<Item = (Vector2<f64>, f64)>) -> Option<Self> {
        let vertex = |(p, value): (Vector2<f64>, f64)| Vertex { position: Point2::new(p.x, p.y), value };
        let mesh = DelaunayTriangulation::bulk_load(samples.into_iter().map(vertex).collect()).ok()?;
        Some(Self { mesh })
    }

    /// The triangle around a position; `None` outside the hull.
    pub(crate) fn around(&self, at: Vector2<f64>) -> Option<Corners> {
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
    pub(crate) fn value(&self, at: Vector2<f64>) -> Option<f64> {
        let corners = self.around(at)?;
        let weights = corners.weights(at);
        Some(weights.iter().zip(corners.values).map(|(w, v)| w * v).sum())
    }

    /// All triangles.
    pub(crate) fn all(&self) -> impl Iterator<Item = Corners> {
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
    pub(crate) fn area(&self) -> f64 {
        let [a, b, c] = self.points;
        (b - a).perp(&(c - a)).abs() / 2.0
    }

    /// Circumradius.
    pub(crate) fn radius(&self) -> f64 {
        let [a, b, c] = self.points;
        (b - a).norm() * (c - b).norm() * (a - c).norm() / (4.0 * self.area())
    }

    /// Barycentric coordinates of a position.
    pub(crate) fn weights(&self, at: Vector2<f64>) -> [f64; 3] {
        let [a, b, c] = self.points;
        let whole = (b - a).perp(&(c - a));
        let (v, w) = ((at - a).perp(&(c - a)) / whole, (b - a).perp(&(at - a)) / whole);
        [1.0 - v - w, v, w]
    }
}

/// Suprema of the derivatives of a function of the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlaneSmoothness {
    /// sup |grad f|.
    pub(crate) slope: f64,
    /// K: sup of the largest |eigenvalue| of the Hessian.
    pub(crate) curvature: f64,
}
