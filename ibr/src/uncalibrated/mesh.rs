//! Triangles between the features of a view.
//!
//! On a plane of the scene chi is an affine function of the pixel in every projective frame, so linear
//! interpolation on triangles is exact on planar facets; that of the projective depth itself would not be.

use super::Point;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::collections::BTreeMap;

/// Of features closer than this, in pixels, only the first is used.
const CLOSEST: f64 = 0.5;

/// Shares of the corners of a triangle in a position; their sum is one.
pub type Shares = [f64; 3];

/// Triangles between features, which cover their convex hull.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    pub(crate) corners: Vec<Point>,
    /// Corners of each triangle by number, all in the same sense of rotation.
    pub(crate) triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// The Delaunay triangulation of some positions.
    ///
    /// Positions that are not finite, or too far out for the triangulation's exact predicates, and those
    /// next to others are no corners of triangles.
    pub fn delaunay(corners: Vec<Point>) -> Self {
        let mut triangulation: DelaunayTriangulation<Point2<f64>> = DelaunayTriangulation::new();
        // The numbers of the corners in the order of the vertices.
        let mut numbers = Vec::new();
        for (number, corner) in corners.iter().enumerate() {
            let position = Point2::new(corner.x, corner.y);
            let near = triangulation.nearest_neighbor(position).map(|near| near.position());
            let is_apart = near.is_none_or(|near| near.distance_2(position) >= CLOSEST * CLOSEST);
            // The library refuses coordinates beyond the range of its exact predicates.
            if is_apart && triangulation.insert(position).is_ok() {
                numbers.push(number);
            }
        }
        let triangles =
            triangulation.inner_faces().map(|face| face.vertices().map(|v| numbers[v.index()])).collect();
        Self { corners, triangles }
    }

    /// The triangles on both sides of each edge by number, one at the hull.
    pub(crate) fn sides(&self) -> BTreeMap<Edge, Vec<usize>> {
        let mut sides: BTreeMap<Edge, Vec<usize>> = BTreeMap::new();
        for (t, triangle) in self.triangles.iter().enumerate() {
            edges(triangle).into_iter().for_each(|edge| sides.entry(edge).or_default().push(t));
        }
        sides
    }

    /// Calls `visit` with pixel, corners and their shares for every pixel centre of every triangle, where
    /// the corners lie at `places` in an image. A pixel on an edge belongs to the triangles on both sides.
    pub fn visit(
        &self,
        places: &[Point],
        size: (usize, usize),
        mut visit: impl FnMut(usize, &[usize; 3], Shares),
    ) {
        for triangle in &self.triangles {
            visit_triangle(&triangle.map(|i| places[i]), size, |p, shares| visit(p, triangle, shares));
        }
    }
}

/// Two corners by number, the smaller one first.
pub(crate) type Edge = (usize, usize);

pub(super) fn edge(a: usize, b: usize) -> Edge {
    (a.min(b), a.max(b))
}

pub(crate) fn edges([a, b, c]: &[usize; 3]) -> [Edge; 3] {
    [edge(*a, *b), edge(*b, *c), edge(*c, *a)]
}

/// The shares of three corners as affine functions of the position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facet {
    origin: Point,
    slopes: [Point; 2],
}

impl Facet {
    /// `None` for corners on a line.
    pub(crate) fn new([a, b, c]: &[Point; 3]) -> Option<Self> {
        let (ab, ac) = (b - a, c - a);
        let area = ab.perp(&ac);
        let slopes = [Point::new(ac.y, -ac.x) / area, Point::new(-ab.y, ab.x) / area];
        (area != 0.0).then_some(Self { origin: *a, slopes })
    }

    pub(crate) fn shares(&self, position: &Point) -> Shares {
        let [b, c] = self.slopes.map(|slope| slope.dot(&(position - self.origin)));
        [1.0 - b - c, b, c]
    }
}

/// Share to which a pixel lies on an edge: shares round.
const ON_EDGE: f64 = 1e-9;

/// Calls `visit` with pixel and shares for every pixel centre of a triangle, row by row.
pub(crate) fn visit_triangle(
    corners: &[Point; 3],
    (width, height): (usize, usize),
    mut visit: impl FnMut(usize, Shares),
) {
    let Some(facet) = Facet::new(corners) else { return };
    let [a, b, c] = corners;
    let range = |low: f64, high: f64, side: usize| {
        low.ceil().max(0.0) as usize..(high.floor() + 1.0).clamp(0.0, side as f64) as usize
    };
    let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
    for y in range(low.y, high.y, height) {
        for x in range(low.x, high.x, width) {
            let shares = facet.shares(&Point::new(x as f64, y as f64));
            if shares.iter().all(|share| *share >= -ON_EDGE) {
                visit(y * width + x, shares);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What `value` gives for every corner, interpolated; NaN outside of the hull.
    fn dense(corners: &[Point], size: (usize, usize), value: impl Fn(&Point) -> f64) -> Vec<f64> {
        let mut dense = vec![f64::NAN; size.0 * size.1];
        Mesh::delaunay(corners.to_vec()).visit(corners, size, |pixel, corner, shares| {
            dense[pixel] = (0..3).map(|k| shares[k] * value(&corners[corner[k]])).sum();
        });
        dense
    }

    #[test]
    fn planes_are_exact_and_the_hull_is_filled() {
        let f = |x: f64, y: f64| 0.3 - 0.02 * x + 0.05 * y;
        let positions =
            [(2.0, 1.0), (17.0, 2.0), (18.0, 12.0), (1.0, 13.0), (9.3, 6.1), (5.5, 9.2), (12.4, 3.3)];
        let corners = positions.map(|(x, y)| Point::new(x, y));
        let hull = [(2.0, 1.0), (17.0, 2.0), (18.0, 12.0), (1.0, 13.0)];
        for (i, got) in dense(&corners, (20, 15), |p| f(p.x, p.y)).iter().enumerate() {
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
    fn doubles_broken_and_collinear_corners_do_no_harm() {
        let corners = [
            (0.0, 0.0),
            (9.0, 0.0),
            (0.0, 9.0),
            (0.1, 0.1),
            (f64::NAN, 1.0),
            (3.0, f64::INFINITY),
            (1e300, 1.0),
        ]
        .map(|(x, y)| Point::new(x, y));
        let found = dense(&corners, (10, 10), |p| if p.x == 0.1 { 77.0 } else { 1.0 });
        assert!((found[11] - 1.0).abs() < 1e-12 && found[99].is_nan());
        assert!(dense(&corners[..2], (10, 10), |_| 1.0).iter().all(|v| v.is_nan()));
        assert!(dense(&[], (3, 3), |_| 1.0).iter().all(|v| v.is_nan()));
    }
}
