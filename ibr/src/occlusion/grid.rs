//! Occlusion removal in the plane. A coarse grid finds the samples near depth edges; these are compared with
//! those in the cells around them, of the size of the radius. Samples whose radii differ by a factor of two
//! or more lie in different grids.

use super::cells::Cells;
use super::points::{Extent, Points, Raster};
use super::{DepthTest, LARGEST_SPACING};
use crate::sample::Sample;
use rayon::prelude::*;

/// Most cells per sample, so that a tiny radius on a wide plane does not exhaust the memory.
const CELLS_A_SAMPLE: usize = 4;

/// Removes the hidden samples and keeps the order of the others; returns how many were removed.
///
/// The ball of a sample meets at most nine cells. Most samples are visible, and the least depth around some
/// of them shows it; only the others are compared with the members. O(n) for the depths, and O(k) for
/// samples near nearer ones, k the number of samples in nine cells. Parallel, with the same bits for any
/// number of threads.
pub fn remove<const C: usize>(samples: &mut Vec<Sample<C>>, test: &DepthTest) -> usize {
    let hidden = hidden(samples, test);
    let before = samples.len();
    let mut flags = hidden.iter();
    samples.retain(|_| !flags.next().copied().unwrap_or(false));
    before - samples.len()
}

/// Which samples are hidden.
pub(crate) fn hidden<const C: usize>(samples: &[Sample<C>], test: &DepthTest) -> Vec<bool> {
    let points = Points::of(samples);
    let mut search = PlaneSearch::default();
    search.clear(&points.extent(), points.len());
    search.enter(&points, test);
    let mut flags = vec![false; samples.len()];
    search.hidden(&points, test).iter().for_each(|i| flags[*i as usize] = true);
    flags
}

/// Finds hidden samples; work memory that is used again.
#[derive(Debug, Clone, Default)]
pub(crate) struct PlaneSearch {
    extent: Extent,
    cells: Cells,
    suspects: Vec<u32>,
    grids: [Grid; LEVELS],
    members: Vec<Member>,
    hidden: Vec<u32>,
}

impl PlaneSearch {
    /// Begins a search among at most `count` samples in a rectangle.
    pub(crate) fn clear(&mut self, extent: &Extent, count: usize) {
        self.extent = *extent;
        self.cells.clear(extent, count);
    }

    /// Looks at the samples that have been appended since the last call.
    pub(crate) fn enter(&mut self, points: &Points, test: &DepthTest) {
        self.cells.enter(points, test);
    }

    /// The places of the hidden ones among the samples that have been entered, in increasing order.
    pub(crate) fn hidden(&mut self, points: &Points, test: &DepthTest) -> &[u32] {
        self.cells.suspects(points, test, &mut self.suspects);
        self.hidden.clear();
        if !self.suspects.is_empty() {
            self.gather(points, test);
            let Self { suspects, grids, members, hidden, .. } = self;
            let is_hidden = |i: &u32| {
                let (i, members) = (*i as usize, &members[..]);
                let [x, y] = [points.x[i], points.y[i]];
                grids.iter().any(|grid| grid.hides(x, y, points.depth[i], members, test))
            };
            hidden.par_extend(suspects.par_iter().with_min_len(4096).copied().filter(is_hidden));
        }
        &self.hidden
    }

    /// Fills the grids with the samples that may hide others.
    fn gather(&mut self, points: &Points, test: &DepthTest) {
        let Self { extent, cells, grids, members, .. } = self;
        members.clear();
        grids.iter_mut().for_each(|grid| grid.heads.clear());
        cells.hiders(points, test, |i| {
            let (x, y, depth, spacing) = (points.x[i], points.y[i], points.depth[i], points.spacing[i]);
            let level = level(spacing);
            let grid = &mut grids[level];
            if grid.heads.is_empty() {
                grid.place(extent, test.radius(LIMITS[level]), CELLS_A_SAMPLE * points.len() + 16);
            }
            let next = grid.insert(members.len() as u32, x, y);
            members.push(Member { x, y, radius: test.radius(spacing), depth, next });
        });
    }
}

/// Largest spacing of the samples in each grid. The spacing on a surface seen from two sides is a little
/// above and below 1, and most samples are in the grid with the smallest cells.
const LIMITS: [f32; LEVELS] = [1.2, 2.4, 4.8, LARGEST_SPACING];
const LEVELS: usize = 4;

/// No sample.
const NONE: u32 = u32::MAX;

/// The grid of a sample.
#[inline]
fn level(spacing: f32) -> usize {
    LIMITS[..LEVELS - 1].iter().map(|limit| usize::from(spacing > *limit)).sum()
}

/// Samples of similar radius in square cells, those of a cell as a linked list: neighbouring samples of a
/// view come one after the other, so building it touches one cell after the other.
#[derive(Debug, Clone, Default)]
struct Grid {
    raster: Raster,
    /// The last member of each cell; empty without members.
    heads: Vec<u32>,
}

/// A sample that may hide others.
#[derive(Debug, Clone, Copy)]
struct Member {
    x: f64,
    y: f64,
    radius: f64,
    depth: f32,
    /// The one before it in its cell.
    next: u32,
}

impl Grid {
    /// Places an empty grid over the extent of all samples, with cells no smaller than `radius`.
    fn place(&mut self, extent: &Extent, radius: f64, most: usize) {
        // Members within the radius lie in neighbouring cells, even if the positions in the grid round.
        self.raster = Raster::over(extent, 1.0001 * radius, most);
        self.heads.resize(self.raster.columns * self.raster.rows, NONE);
    }

    /// Adds a member; returns the one before it in its cell.
    #[inline]
    fn insert(&mut self, index: u32, x: f64, y: f64) -> u32 {
        let (column, row) = self.raster.cell(x, y);
        std::mem::replace(&mut self.heads[row * self.raster.columns + column], index)
    }

    /// Whether any member hides a sample with this position and depth: comparison with those in the nine
    /// cells around.
    fn hides(&self, x: f64, y: f64, depth: f32, members: &[Member], test: &DepthTest) -> bool {
        if self.heads.is_empty() {
            return false;
        }
        let (column, row) = self.raster.cell(x, y);
        let columns = column.saturating_sub(1)..(column + 2).min(self.raster.columns);
        let hides = |m: &Member| {
            test.hides(f64::from(m.depth), f64::from(depth)) && DepthTest::close(x - m.x, y - m.y, m.radius)
        };
        (row.saturating_sub(1)..(row + 2).min(self.raster.rows)).any(|r| {
            let cells = &self.heads[r * self.raster.columns..][columns.clone()];
            cells.iter().any(|head| list(members, *head).any(hides))
        })
    }
}

/// The members of the list that begins with `head`.
#[inline]
fn list(members: &[Member], head: u32) -> impl Iterator<Item = &Member> {
    std::iter::successors(members.get(head as usize), |m| members.get(m.next as usize))
}

#[cfg(test)]
mod tests {
    use super::super::points::RUN;
    use super::*;
    use proptest::prelude::*;

    fn sample(x: f64, y: f64, depth: f32) -> Sample<1> {
        Sample { x, y, depth, ..Sample::BLANK }
    }

    fn check(samples: &[Sample<1>], test: &DepthTest) {
        assert_eq!(hidden(samples, test), test.hidden_by_definition(samples), "{test:?}");
    }

    #[test]
    fn empty_single_and_coinciding() {
        let test = DepthTest::default();
        check(&[], &test);
        check(&[sample(1.0, 1.0, 1.0)], &test);
        check(&[sample(1.0, 1.0, 1.0); 5], &test);
        check(&[sample(1.0, 1.0, 1.0), sample(1.0, 1.0, 2.0), sample(1e9, -1e9, 2.0)], &test);
        check(&[sample(f64::NAN, 1.0, 1.0), sample(1.0, 1.0, 1.0), sample(1.0, f64::NAN, 2.0)], &test);
        check(&[sample(f64::NAN, f64::NAN, 1.0); 2], &test);
        check(&[sample(1.0, 1.0, f32::NAN), sample(1.0, 1.0, 2.0), sample(1.0, 1.2, 1.0)], &test);
    }

    #[test]
    fn exactly_on_the_circle_counts() {
        let test = DepthTest { epsilon: 5.0, relative: 0.0, absolute: 1.0, parallax: 0.0 };
        let mut pair = vec![sample(0.0, 0.0, -3.0), sample(3.0, 4.0, -2.0), sample(3.0, 4.1, -2.0)];
        assert_eq!(remove(&mut pair, &test), 1);
        assert_eq!(pair.len(), 2);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn equal_to_the_definition(
            raw in prop::collection::vec((-20.0..20.0_f64, -3.0..9.0_f64, 0.5..9.0_f32, 0.2..12.0_f32), 0..150),
            coarse: bool, wide: bool, epsilon in 0.1..4.0_f64, relative in 0.0..0.3_f64, parallax in 0.0..0.4_f64,
            lift in -20.0..5.0_f32
        ) {
            let position = |x: f64| if coarse { (x * 2.0).round() / 2.0 } else { x };
            let samples: Vec<Sample<1>> = raw
                .iter()
                .map(|(x, y, d, spacing)| {
                    let depth = if coarse { d.round() } else { *d };
                    Sample { spacing: if wide { *spacing } else { 1.0 }, ..sample(position(*x), position(*y), depth) }
                })
                .collect();
            check(&samples, &DepthTest { epsilon: position(epsilon).max(0.5), relative, absolute: 0.1, parallax });
            // Signed keys, as chi gives them, with an absolute threshold.
            let signed: Vec<Sample<1>> =
                samples.iter().map(|s| Sample { depth: s.depth + lift, ..*s }).collect();
            check(&signed, &DepthTest { epsilon, relative: 0.0, absolute: 0.5, parallax: 0.0 });
        }

        /// Samples that only hide others, places without a sample, several calls, and memory used before.
        #[test]
        fn a_search_in_parts_decides_on_its_own_samples(
            raw in prop::collection::vec((0.0..30.0_f64, 0.0..9.0_f64, 0.5..9.0_f32, 0.2..12.0_f32, 0..4), 1..300),
            cut in 0..300_usize, epsilon in 0.1..4.0_f64, relative in 0.0..0.3_f64
        ) {
            let samples: Vec<Sample<1>> = raw
                .iter()
                .map(|(x, y, d, spacing, kind)| match kind {
                    0 => Sample { spacing: f32::NAN, ..sample(f64::NAN, f64::NAN, f32::NAN) },
                    _ => Sample { spacing: *spacing, ..sample(*x, *y, *d) },
                })
                .collect();
            let test = DepthTest { epsilon, relative, absolute: 0.1, parallax: 0.0 };
            let mut points = Points::of(&samples);
            raw.iter().enumerate().for_each(|(i, s)| points.own[i] = s.4 > 1);
            let own = |i: &usize| points.own[*i];
            let hidden = test.hidden_by_definition(&samples);
            let want: Vec<u32> = (0..raw.len()).filter(|i| hidden[*i]).filter(own).map(|i| i as u32).collect();
            let mut part = points.clone();
            part.resize((cut.min(raw.len()) / RUN) * RUN);
            let extent = Extent { left: -1.0, right: 31.0, top: 0.0, bottom: 9.0 };
            let mut search = PlaneSearch::default();
            for _ in 0..2 {
                search.clear(&extent, points.len());
                search.enter(&part, &test);
                search.enter(&points, &test);
                prop_assert_eq!(search.hidden(&points, &test), &want);
            }
        }
    }
}
