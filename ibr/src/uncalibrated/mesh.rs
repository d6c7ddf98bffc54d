//! Dense chi from sparse features: linear interpolation on Delaunay triangles in the image.
//!
//! On a plane of the scene chi is an affine function of the pixel in every projective frame, so the
//! interpolation is exact on planar facets; that of the projective depth itself would not be.

use super::Point;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

/// Of features closer than this, in pixels, only the first is used.
const CLOSEST: f64 = 0.5;

/// A feature with its chi.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    /// Position in pixels.
    pub position: Point,
    /// chi there.
    pub chi: f64,
}

/// Triangles between features of one view, which cover their convex hull.
///
/// ```
/// use hybank_ibr::uncalibrated::Point;
/// use hybank_ibr::uncalibrated::mesh::{Feature, Mesh};
///
/// // On a plane chi is an affine function of the pixel, here x / 4.
/// let corners = [(0.0, 0.0), (4.0, 0.0), (0.0, 2.0), (4.0, 2.0)];
/// let features = corners.map(|(x, y)| Feature { position: Point::new(x, y), chi: 0.25 * x });
/// let mesh = Mesh::delaunay(&features);
/// assert_eq!(mesh.triangles(), 2);
/// assert_eq!(mesh.chi((5, 3))[5 + 2], 0.5);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    pub(super) corners: Vec<Feature>,
    /// Corners of each triangle by number, all in the same sense of rotation.
    pub(super) triangles: Vec<[usize; 3]>,
}

struct Vertex {
    position: Point2<f64>,
    feature: Feature,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

impl Mesh {
    /// The Delaunay triangulation.
    ///
    /// Features that are not finite, or too far out for the triangulation's exact predicates, are left out.
    pub fn delaunay(features: &[Feature]) -> Self {
        let triangulation = triangulate(features);
        let corners = triangulation.vertices().map(|v| v.data().feature).collect();
        let triangles = triangulation.inner_faces().map(|f| f.vertices().map(|v| v.index())).collect();
        Self { corners, triangles }
    }

    /// The number of triangles.
    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// chi at every pixel centre within the hull, NaN outside; rows from the top.
    pub fn chi(&self, size: (usize, usize)) -> Vec<f64> {
        let mut chi = vec![f64::NAN; size.0 * size.1];
        self.visit(size, |_, pixel, value| chi[pixel] = value);
        chi
    }

    /// Calls `visit` with triangle, pixel and chi for every pixel centre of every triangle. A pixel on an
    /// edge belongs to the triangles on both sides, which agree there.
    pub fn visit(&self, size: (usize, usize), mut visit: impl FnMut(usize, usize, f64)) {
        for (number, triangle) in self.triangles.iter().enumerate() {
            let corner = triangle.map(|i| self.corners[i]);
            visit_triangle(&corner, size, |pixel, chi| visit(number, pixel, chi));
        }
    }
}

/// chi at every pixel centre within the convex hull of the features by their Delaunay triangulation.
pub fn dense_chi(features: &[Feature], size: (usize, usize)) -> Vec<f64> {
    Mesh::delaunay(features).chi(size)
}

fn triangulate(features: &[Feature]) -> DelaunayTriangulation<Vertex> {
    let mut triangulation = DelaunayTriangulation::new();
    for f in features {
        let position = Point2::new(f.position.x, f.position.y);
        let apart = triangulation.nearest_neighbor(position).is_none_or(
            |near: spade::handles::VertexHandle<'_, Vertex, _, _, _>| {
                near.position().distance_2(position) >= CLOSEST * CLOSEST
            },
        );
        if f.chi.is_finite() && apart {
            // The library refuses coordinates beyond the range of its exact predicates; such features are
            // skipped.
            let _ = triangulation.insert(Vertex { position, feature: *f });
        }
    }
    triangulation
}

/// chi as an affine function of the position: the plane through three features.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facet {
    origin: Feature,
    slope: Point,
}

impl Facet {
    /// `None` for features on a line.
    pub(super) fn new(corner: &[Feature; 3]) -> Option<Self> {
        let [a, b, c] = corner;
        let (ab, ac) = (b.position - a.position, c.position - a.position);
        let area = ab.perp(&ac);
        let (up, vp) = (b.chi - a.chi, c.chi - a.chi);
        let slope = Point::new(up * ac.y - vp * ab.y, vp * ab.x - up * ac.x) / area;
        (area != 0.0).then_some(Self { origin: *a, slope })
    }

    pub(super) fn chi(&self, position: &Point) -> f64 {
        self.origin.chi + self.slope.dot(&(position - self.origin.position))
    }
}

/// The linear interpolant at the pixel centres of a triangle, row by row.
fn visit_triangle(corner: &[Feature; 3], (width, height): (usize, usize), mut visit: impl FnMut(usize, f64)) {
    let Some(facet) = Facet::new(corner) else { return };
    let positions = corner.map(|f| f.position);
    let [a, b, c] = positions;
    let top = a.y.min(b.y).min(c.y).ceil().max(0.0) as usize;
    let bottom = a.y.max(b.y).max(c.y).floor().min(height as f64 - 1.0);
    for y in top..(bottom + 1.0).max(0.0) as usize {
        let Some((left, right)) = span(&positions, y as f64) else { continue };
        let end = (right.floor().min(width as f64 - 1.0) + 1.0).max(0.0) as usize;
        for x in left.ceil().max(0.0) as usize..end {
            visit(y * width + x, facet.chi(&Point::new(x as f64, y as f64)));
        }
    }
}

/// The columns between which a row meets a triangle.
fn span(corners: &[Point; 3], y: f64) -> Option<(f64, f64)> {
    let mut ends: Option<(f64, f64)> = None;
    for (p, q) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corners[i], corners[j])) {
        if (p.y <= y) == (q.y <= y) && p.y != y && q.y != y {
            continue;
        }
        let crossings =
            if p.y == q.y { [p.x, q.x] } else { [p.x + (q.x - p.x) * (y - p.y) / (q.y - p.y); 2] };
        let on_edge = (p.y.min(q.y)..=p.y.max(q.y)).contains(&y);
        for x in crossings.into_iter().filter(|_| on_edge) {
            ends = Some(ends.map_or((x, x), |(l, r)| (l.min(x), r.max(x))));
        }
    }
    ends
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feature(x: f64, y: f64, chi: f64) -> Feature {
        Feature { position: Point::new(x, y), chi }
    }

    #[test]
    fn planes_are_exact_and_the_hull_is_filled() {
        let f = |x: f64, y: f64| 0.3 - 0.02 * x + 0.05 * y;
        let positions =
            [(2.0, 1.0), (17.0, 2.0), (18.0, 12.0), (1.0, 13.0), (9.3, 6.1), (5.5, 9.2), (12.4, 3.3)];
        let features: Vec<Feature> = positions.iter().map(|(x, y)| feature(*x, *y, f(*x, *y))).collect();
        let chi = dense_chi(&features, (20, 15));
        let hull = [(2.0, 1.0), (17.0, 2.0), (18.0, 12.0), (1.0, 13.0)];
        for (i, got) in chi.iter().enumerate() {
            let (x, y) = ((i % 20) as f64, (i / 20) as f64);
            let side = |k: usize| {
                let (p, q): ((f64, f64), (f64, f64)) = (hull[k], hull[(k + 1) % 4]);
                (q.0 - p.0) * (y - p.1) - (q.1 - p.1) * (x - p.0)
            };
            let depth = (0..4).map(side).fold(f64::MAX, f64::min);
            if depth > 1e-9 {
                assert!((got - f(x, y)).abs() < 1e-12, "({x}, {y}): {got}");
            } else if depth < -1e-9 {
                assert!(got.is_nan(), "({x}, {y}): {got}");
            }
        }
    }

    #[test]
    fn doubles_broken_and_collinear_features_do_no_harm() {
        let mut features = vec![
            feature(0.0, 0.0, 1.0),
            feature(9.0, 0.0, 1.0),
            feature(0.0, 9.0, 1.0),
            feature(0.1, 0.1, 77.0),
            feature(f64::NAN, 1.0, 1.0),
            feature(3.0, 3.0, f64::INFINITY),
            feature(1e300, 1.0, 1.0),
        ];
        let chi = dense_chi(&features, (10, 10));
        assert_eq!(chi[11], 1.0);
        assert!(chi[99].is_nan());
        features.truncate(2);
        assert!(dense_chi(&features, (10, 10)).iter().all(|c| c.is_nan()));
        assert!(dense_chi(&[], (3, 3)).iter().all(|c| c.is_nan()));
    }
}
