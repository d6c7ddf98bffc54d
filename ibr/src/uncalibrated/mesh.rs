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

struct Vertex {
    position: Point2<f64>,
    chi: f64,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// chi at every pixel centre within the convex hull of the features, NaN outside; rows from the top.
///
/// Features that are not finite, or too far out for the triangulation's exact predicates, are left out. A
/// pixel on an edge belongs to the triangles on both sides, which agree there.
pub fn dense_chi(features: &[Feature], (width, height): (usize, usize)) -> Vec<f64> {
    let mut chi = vec![f64::NAN; width * height];
    let triangulation = triangulate(features);
    for face in triangulation.inner_faces() {
        let corner = face.vertices().map(|v| (v.position(), v.data().chi));
        fill_triangle(&corner, (width, height), &mut chi);
    }
    chi
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
            let _ = triangulation.insert(Vertex { position, chi: f.chi });
        }
    }
    triangulation
}

/// Writes the linear interpolant at the pixel centres of a triangle, row by row.
fn fill_triangle(corner: &[(Point2<f64>, f64); 3], (width, height): (usize, usize), chi: &mut [f64]) {
    let [(a, fa), (b, fb), (c, fc)] = *corner;
    let area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    if area == 0.0 {
        return;
    }
    let gx = ((fb - fa) * (c.y - a.y) - (fc - fa) * (b.y - a.y)) / area;
    let gy = ((fc - fa) * (b.x - a.x) - (fb - fa) * (c.x - a.x)) / area;
    let top = a.y.min(b.y).min(c.y).ceil().max(0.0) as usize;
    let bottom = a.y.max(b.y).max(c.y).floor().min(height as f64 - 1.0);
    for y in top..(bottom + 1.0).max(0.0) as usize {
        let Some((left, right)) = span(&[a, b, c], y as f64) else { continue };
        let end = (right.floor().min(width as f64 - 1.0) + 1.0).max(0.0) as usize;
        for x in left.ceil().max(0.0) as usize..end {
            chi[y * width + x] = fa + gx * (x as f64 - a.x) + gy * (y as f64 - a.y);
        }
    }
}

/// The columns between which a row meets a triangle.
fn span(corners: &[Point2<f64>; 3], y: f64) -> Option<(f64, f64)> {
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
