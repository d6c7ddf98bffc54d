//! Occlusion removal in the plane. A coarse grid finds the samples near depth edges; these are compared with
//! those whose radii reach into their cell.

use super::DepthTest;
use super::cells::Cells;
use super::points::Points;
use rayon::prelude::*;
use std::ops::Range;

/// Finds hidden samples; work memory that is used again.
///
/// Most samples are visible, and the least depth around some of them shows it; only the others are compared
/// with what may hide them. O(n) where few samples share a pixel. Of many, those of a cell are a k-d tree:
/// O(n log n) to build it, and a search looks at the boxes that the border of a ball cuts. Parallel, with
/// the same bits for any number of threads.
#[derive(Debug, Clone, Default)]
pub(crate) struct PlaneSearch {
    cells: Cells,
    suspects: Vec<u32>,
    hiders: Vec<u32>,
    /// The hiders whose radii reach into each cell with suspects, cell after cell.
    members: Vec<u32>,
    /// The first member of each cell, and the end of the last one.
    starts: Vec<usize>,
    /// Bounds of the nodes of the trees, see [`node`].
    bounds: Vec<Bounds>,
    hidden: Vec<u32>,
}

impl PlaneSearch {
    /// The places of the hidden samples, in increasing order.
    pub(crate) fn hidden(&mut self, points: &Points, test: &DepthTest) -> &[u32] {
        self.cells.enter(points, test);
        self.cells.suspects(points, test, &mut self.suspects);
        self.hidden.clear();
        if !self.suspects.is_empty() {
            self.gather(points, test);
            let Self { cells, suspects, members, starts, bounds, hidden, .. } = self;
            let search = Search { points, test, members, bounds };
            let is_hidden = |i: &u32| {
                let cell = cells.cell(points, *i as usize);
                search.hides(starts[cell]..starts[cell + 1], *i as usize)
            };
            match suspects.len() > FEW_SUSPECTS {
                true => hidden
                    .par_extend(suspects.par_iter().with_min_len(FEW_SUSPECTS).copied().filter(is_hidden)),
                false => hidden.extend(suspects.iter().copied().filter(is_hidden)),
            }
        }
        &self.hidden
    }

    /// Sorts the samples that may hide others by the cells into which they reach, and plants trees where a
    /// cell has many.
    fn gather(&mut self, points: &Points, test: &DepthTest) {
        let Self { cells, hiders, members, starts, bounds, .. } = self;
        hiders.clear();
        cells.hiders(points, test, |i| hiders.push(i as u32));
        starts.clear();
        starts.resize(cells.count() + 1, 0);
        for i in hiders.iter() {
            cells.reached(points, test, *i as usize, |cell| starts[cell] += 1);
        }
        let mut sum = 0;
        for start in starts.iter_mut() {
            sum += *start;
            *start = sum;
        }
        members.resize(sum, 0);
        for i in hiders.iter().rev() {
            cells.reached(points, test, *i as usize, |cell| {
                starts[cell] -= 1;
                members[starts[cell]] = *i;
            });
        }
        bounds.resize(node(sum) + 1, Bounds::NONE);
        for cell in starts.windows(2) {
            plant(points, test, members, bounds, cell[0]..cell[1]);
        }
    }
}

/// Suspects that one thread decides on.
const FEW_SUSPECTS: usize = 4096;

/// Members that are compared one by one.
const FEW: usize = 32;

/// The place of the bounds of a node: the node of more than [`FEW`] members is called by the middle of their
/// range, and two middles are half of that apart at least.
fn node(middle: usize) -> usize {
    middle / (FEW / 2)
}

/// Column, row and radius of some members, and their least depth.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    low: [f64; 3],
    high: [f64; 3],
    near: f32,
}

impl Bounds {
    const NONE: Self = Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3], near: f32::INFINITY };

    fn with(mut self, at: [f64; 3], depth: f32) -> Self {
        for (k, v) in at.into_iter().enumerate() {
            (self.low[k], self.high[k]) = (self.low[k].min(v), self.high[k].max(v));
        }
        self.near = self.near.min(depth);
        self
    }
}

fn ball(points: &Points, test: &DepthTest, i: u32) -> [f64; 3] {
    let i = i as usize;
    [points.x[i], points.y[i], test.radius(points.spacing[i])]
}

/// Sorts members into halves of halves, each time where they differ most.
fn plant(points: &Points, test: &DepthTest, members: &mut [u32], bounds: &mut [Bounds], range: Range<usize>) {
    if range.len() <= FEW {
        return;
    }
    let (half, own) = (range.len() / 2, &mut members[range.clone()]);
    let all =
        own.iter().fold(Bounds::NONE, |all, i| all.with(ball(points, test, *i), points.depth[*i as usize]));
    let extent = |k: &usize| all.high[*k] - all.low[*k];
    let axis = (0..3).max_by(|a, b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    let at = |i: &u32| ball(points, test, *i)[axis];
    own.select_nth_unstable_by(half, |a, b| at(a).total_cmp(&at(b)));
    let middle = range.start + half;
    bounds[node(middle)] = all;
    plant(points, test, members, bounds, range.start..middle);
    plant(points, test, members, bounds, middle..range.end);
}

struct Search<'a> {
    points: &'a Points,
    test: &'a DepthTest,
    members: &'a [u32],
    bounds: &'a [Bounds],
}

impl Search<'_> {
    /// Whether any of some members hides a sample. Distances from bounds round as those from members do, so
    /// that both decide alike.
    fn hides(&self, range: Range<usize>, suspect: usize) -> bool {
        let Self { points, test, members, bounds } = *self;
        let (x, y, depth) = (points.x[suspect], points.y[suspect], f64::from(points.depth[suspect]));
        if range.len() <= FEW {
            return members[range].iter().any(|i| {
                let [column, row, radius] = ball(points, test, *i);
                let near = f64::from(points.depth[*i as usize]);
                test.hides(near, depth) && DepthTest::close(x - column, y - row, radius)
            });
        }
        let middle = range.start + range.len() / 2;
        let Bounds { low, high, near } = bounds[node(middle)];
        let nearest = |k: usize, at: f64| (low[k] - at).max(at - high[k]).max(0.0);
        let farthest = |k: usize, at: f64| (at - low[k]).max(high[k] - at);
        if !test.hides(f64::from(near), depth) || !DepthTest::close(nearest(0, x), nearest(1, y), high[2]) {
            return false;
        }
        // All of them are close, and so is the one with the least depth.
        DepthTest::close(farthest(0, x), farthest(1, y), low[2])
            || self.hides(range.start..middle, suspect)
            || self.hides(middle..range.end, suspect)
    }
}

#[cfg(test)]
pub(crate) mod tests;
