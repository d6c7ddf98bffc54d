//! Edges of a mesh that the photographs choose.
//!
//! Delaunay's edges know nothing of depth: where a surface ends, some of them join its corners with what
//! lies behind it. Of the two diagonals of a quadrilateral, one gives the surface whose pixels have the
//! same colours in other views (D. D. Morris and T. Kanade, Image-consistent surface triangulation, CVPR
//! 2000). Diagonals are exchanged one by one while the colours improve.

use super::Point;
use super::mesh::{Edge, Facet, Mesh, Shares, edge};
use std::collections::{BTreeMap, VecDeque};

/// Pixels of a quadrilateral that are compared, about, at most.
const MOST_PIXELS: f64 = 400.0;

/// Share of the differences that an exchange must save: less may be chance.
const LEAST_SAVING: f64 = 0.1;

/// Mean saving per pixel that an exchange needs, in grey levels.
const LEAST_MEAN: f64 = 0.5;

/// Times that each edge is looked at, on average, at most. The saving of large quadrilaterals is
/// estimated, so the sum of all differences alone does not end the search.
const MOST_LOOKS: usize = 20;

/// Exchanges diagonals of the mesh while the colours of the views improve. `miss` returns by how much the
/// views differ, in grey levels, where the corners of a triangle have some shares, and `None` where no two
/// of them show it.
pub fn exchange(mesh: &mut Mesh, miss: impl Fn(&[usize; 3], Shares) -> Option<f64>) {
    let mut sides = mesh.sides();
    let mut queue: VecDeque<Edge> = sides.keys().copied().collect();
    for _ in 0..MOST_LOOKS * sides.len() {
        let Some(next) = queue.pop_front() else { break };
        let Some(quad) = Quad::new(mesh, &sides, next) else { continue };
        if quad.is_better_exchanged(&mesh.corners, &miss) {
            quad.exchange(mesh, &mut sides);
            queue.extend(quad.border());
        }
    }
}

/// The two triangles a b c and b a d on both sides of the edge a b.
#[derive(Debug, Clone, Copy)]
struct Quad {
    a: usize,
    b: usize,
    c: usize,
    d: usize,
    triangles: [usize; 2],
}

impl Quad {
    /// `None` for edges of the hull, and where the other diagonal would not lie within the quadrilateral.
    fn new(mesh: &Mesh, sides: &BTreeMap<Edge, Vec<usize>>, (a, b): Edge) -> Option<Self> {
        let [first, second] = *sides.get(&(a, b))?.as_slice() else { return None };
        let opposite = |t: usize| mesh.triangles[t].into_iter().find(|i| *i != a && *i != b);
        let follows = |t: usize| {
            let [i, j, k] = mesh.triangles[t];
            [(i, j), (j, k), (k, i)].contains(&(a, b))
        };
        let (left, right) = if follows(first) { (first, second) } else { (second, first) };
        let quad = Self { a, b, c: opposite(left)?, d: opposite(right)?, triangles: [left, right] };
        quad.is_convex(&mesh.corners).then_some(quad)
    }

    fn around(&self) -> [usize; 4] {
        [self.a, self.d, self.b, self.c]
    }

    fn border(&self) -> [Edge; 4] {
        let [p, q, r, s] = self.around();
        [edge(p, q), edge(q, r), edge(r, s), edge(s, p)]
    }

    /// Whether all four angles turn the same way, and none is nearly straight.
    fn is_convex(&self, corners: &[Point]) -> bool {
        let at = self.around().map(|i| corners[i]);
        let turn = |k: usize| {
            let (to, from) = (at[(k + 2) % 4] - at[(k + 1) % 4], at[(k + 1) % 4] - at[k]);
            from.perp(&to) / (from.norm() * to.norm())
        };
        let turns: [f64; 4] = std::array::from_fn(turn);
        turns.iter().all(|t| *t > 1e-3) || turns.iter().all(|t| *t < -1e-3)
    }

    fn is_better_exchanged(
        &self,
        corners: &[Point],
        miss: &impl Fn(&[usize; 3], Shares) -> Option<f64>,
    ) -> bool {
        let Self { a, b, c, d, .. } = *self;
        let beside =
            |from: usize, to: usize, p: &Point| (corners[to] - corners[from]).perp(&(p - corners[from]));
        // The sides of the diagonals on which c and b lie.
        let (of_c, of_b) = (beside(a, b, &corners[c]), beside(c, d, &corners[b]));
        let miss =
            |corner: [usize; 3], p: &Point| miss(&corner, Facet::new(&corner.map(|i| corners[i]))?.shares(p));
        let (mut old, mut new, mut count) = (0.0, 0.0, 0.0_f64);
        for p in self.pixels(corners) {
            let now = if beside(a, b, &p) * of_c > 0.0 { [a, b, c] } else { [b, a, d] };
            let then = if beside(c, d, &p) * of_b > 0.0 { [c, d, b] } else { [d, c, a] };
            if let (Some(m), Some(n)) = (miss(now, &p), miss(then, &p)) {
                (old, new, count) = (old + m, new + n, count + 1.0);
            }
        }
        old - new > LEAST_SAVING * old && old - new > LEAST_MEAN * count
    }

    /// Pixel centres within, on a grid that gives no more than about MOST_PIXELS.
    fn pixels(&self, corners: &[Point]) -> impl Iterator<Item = Point> {
        let at = self.around().map(|i| corners[i]);
        let area = (at[2] - at[0]).perp(&(at[3] - at[1])).abs() / 2.0;
        let step = (area / MOST_PIXELS).sqrt().ceil().max(1.0);
        let low = at.iter().fold(at[0], |l, p| l.inf(p)).map(|v| (v / step).ceil() * step);
        let high = at.iter().fold(at[0], |h, p| h.sup(p));
        let sense = (at[1] - at[0]).perp(&(at[2] - at[1])).signum();
        let inside =
            move |p: &Point| (0..4).all(|k| (at[(k + 1) % 4] - at[k]).perp(&(p - at[k])) * sense >= 0.0);
        let count =
            |k: usize| ((high[k] - low[k]) / step).max(-1.0) as usize + usize::from(high[k] >= low[k]);
        let (columns, rows) = (count(0), count(1));
        (0..rows)
            .flat_map(move |j| (0..columns).map(move |i| low + Point::new(i as f64, j as f64) * step))
            .filter(inside)
    }

    fn exchange(&self, mesh: &mut Mesh, sides: &mut BTreeMap<Edge, Vec<usize>>) {
        let Self { a, b, c, d, triangles: [left, right] } = *self;
        mesh.triangles[left] = [c, d, b];
        mesh.triangles[right] = [d, c, a];
        sides.remove(&edge(a, b));
        sides.insert(edge(c, d), vec![left, right]);
        let mut replace = |e: Edge, from: usize, to: usize| {
            if let Some(both) = sides.get_mut(&e) {
                both.iter_mut().filter(|t| **t == from).for_each(|t| *t = to);
            }
        };
        replace(edge(c, a), left, right);
        replace(edge(b, d), right, left);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncalibrated::random::dice::Dice;

    /// Corners on a disturbed grid of 7 x 7 points, ten pixels apart.
    fn mesh(shake: f64) -> Mesh {
        let dice = &mut Dice::new(5);
        let place = |k: usize| {
            let (dx, dy) = (dice.within(-shake, shake), dice.within(-shake, shake));
            Point::new(10.0 * (k % 7) as f64 + dx, 10.0 * (k / 7) as f64 + dy)
        };
        Mesh::delaunay((0..49).map(place).collect())
    }

    /// A position in a triangle, and the interpolant of `chi` there.
    fn interpolated(
        corners: &[Point],
        corner: &[usize; 3],
        shares: Shares,
        chi: impl Fn(&Point) -> f64,
    ) -> (Point, f64) {
        let at = |k: usize| corners[corner[k]];
        ((0..3).map(|k| at(k) * shares[k]).sum(), (0..3).map(|k| chi(&at(k)) * shares[k]).sum())
    }

    /// Exchanges edges until the interpolant of `chi` fits `shown`.
    fn fit(mesh: &mut Mesh, chi: impl Fn(&Point) -> f64, shown: impl Fn(&Point) -> f64) {
        let corners = mesh.corners.clone();
        exchange(mesh, |corner, shares| {
            let (p, chi) = interpolated(&corners, corner, shares, &chi);
            Some((chi - shown(&p)).abs())
        })
    }

    fn areas(mesh: &Mesh) -> Vec<f64> {
        let area = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|i| mesh.corners[i]);
            (b - a).perp(&(c - a)) / 2.0
        };
        mesh.triangles.iter().map(area).collect()
    }

    /// A roof whose ridge runs along the diagonals of the grid: the right edges give it exactly.
    #[test]
    fn a_ridge_is_found() {
        let roof = |p: &Point| (p.x - p.y).abs();
        let across = |p: &Point| (p.x + p.y - 60.0).abs();
        let mut found = mesh(0.0);
        let worst = |mesh: &Mesh| {
            let mut worst = 0.0_f64;
            mesh.visit(&mesh.corners, (61, 61), |_, corner, shares| {
                let (p, chi) = interpolated(&mesh.corners, corner, shares, roof);
                worst = worst.max((chi - roof(&p)).abs());
            });
            worst
        };
        // Delaunay's diagonals of a square are a matter of chance; these all cross the ridge.
        fit(&mut found, across, across);
        assert!(worst(&found) > 4.0);
        fit(&mut found, roof, roof);
        assert!(worst(&found) < 1e-12, "{}", worst(&found));
    }

    #[test]
    fn a_plane_keeps_its_edges() {
        let plane = |p: &Point| 0.3 * p.x - 0.1 * p.y;
        let mut found = mesh(3.0);
        let before = found.clone();
        fit(&mut found, plane, plane);
        exchange(&mut found, |_, _| None);
        assert_eq!(found, before);
    }

    /// Colours without sense exchange edges at random; the triangles still cover the hull once.
    #[test]
    fn the_hull_stays_covered() {
        let mut found = mesh(4.0);
        let before: f64 = areas(&found).iter().sum();
        let noise = |corner: &[usize; 3], shares: Shares| {
            Some(50.0 * (1e4 * (shares[0] + corner[0] as f64 * shares[1])).sin().abs())
        };
        exchange(&mut found, noise);
        let after = areas(&found);
        assert!(after.iter().all(|a| a * before > 0.0), "{after:?}");
        assert!((after.iter().sum::<f64>() - before).abs() < 1e-9 * before.abs());
    }
}
