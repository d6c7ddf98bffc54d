//! Occlusion removal in the plane: a grid of cells of the size of the radius, with the least depth around
//! each cell. Samples whose radii differ by a factor of two or more lie in different grids.

use super::DepthTest;
use crate::sample::Sample;
use rayon::prelude::*;

/// Most cells per sample, so that a tiny radius on a wide plane does not exhaust the memory.
const CELLS_A_SAMPLE: usize = 4;

/// Removes the hidden samples and keeps the order of the others; returns how many were removed.
///
/// The ball of a sample meets at most nine cells. Most samples are visible, and one comparison with the
/// least depth in these cells shows it; only the others are compared with the members. O(n) for the grid,
/// and O(k) for samples near nearer ones, k the number of samples in nine cells. Parallel, with the same
/// bits for any number of threads.
pub fn remove<const C: usize>(samples: &mut Vec<Sample<C>>, test: &DepthTest) -> usize {
    let hidden = hidden(samples, test);
    let before = samples.len();
    let mut flags = hidden.iter();
    samples.retain(|_| !flags.next().copied().unwrap_or(false));
    before - samples.len()
}

/// Which samples are hidden.
pub(crate) fn hidden<const C: usize>(samples: &[Sample<C>], test: &DepthTest) -> Vec<bool> {
    if samples.is_empty() {
        return Vec::new();
    }
    let extent = Extent::of(samples);
    let mut next = vec![NONE; samples.len()];
    let mut grids: [Option<Grid>; LEVELS] = [const { None }; LEVELS];
    for (i, s) in samples.iter().enumerate() {
        let level = level(s.spacing);
        let radius = || test.radius((1 << level) as f32);
        let grid = grids[level].get_or_insert_with(|| Grid::new(samples.len(), &extent, radius()));
        next[i] = grid.insert(i as u32, s);
    }
    let grids: Vec<Grid> = grids.into_iter().flatten().map(Grid::with_neighbours).collect();
    let members = Members { samples, next: &next, test };
    let hidden = |s: &Sample<C>| grids.iter().any(|grid| grid.hides(s, &members));
    samples.par_iter().with_min_len(16_384).map(hidden).collect()
}

/// Grids for samples of spacing up to 1, 2, 4 and 8.
const LEVELS: usize = 4;

/// No sample.
const NONE: u32 = u32::MAX;

/// The grid of a sample.
#[inline]
fn level(spacing: f32) -> usize {
    [1.0, 2.0, 4.0].iter().map(|limit| usize::from(spacing > *limit)).sum()
}

/// The rectangle that holds all samples.
struct Extent {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Extent {
    fn of<const C: usize>(samples: &[Sample<C>]) -> Self {
        let none = Self { left: f64::MAX, right: f64::MIN, top: f64::MAX, bottom: f64::MIN };
        samples.iter().fold(none, |e, s| Self {
            left: e.left.min(s.x),
            right: e.right.max(s.x),
            top: e.top.min(s.y),
            bottom: e.bottom.max(s.y),
        })
    }
}

/// Samples of similar radius in square cells, those of a cell as a linked list: neighbouring samples of a
/// view come one after the other, so building it touches one cell after the other.
struct Grid {
    left: f64,
    top: f64,
    /// Cells per pixel.
    scale: f64,
    columns: usize,
    rows: usize,
    /// The last member of each cell.
    heads: Vec<u32>,
    /// Least depth of the members in each cell, and later in it and its eight neighbours.
    least: Vec<f32>,
}

/// All samples, and the one before each in its cell.
struct Members<'a, const C: usize> {
    samples: &'a [Sample<C>],
    next: &'a [u32],
    test: &'a DepthTest,
}

impl Grid {
    /// An empty grid over the extent of all samples, with cells no smaller than `radius`.
    fn new(samples: usize, extent: &Extent, radius: f64) -> Self {
        let Extent { left, right, top, bottom } = *extent;
        // Members within the radius lie in neighbouring cells, even if the positions in the grid round.
        let mut edge = 1.0001 * radius;
        let limit = (CELLS_A_SAMPLE * samples + 16) as f64;
        // The doubling ends at the latest when one cell holds all samples.
        while ((right - left) / edge + 1.0) * ((bottom - top) / edge + 1.0) > limit {
            edge *= 2.0;
        }
        let scale = 1.0 / edge;
        let columns = ((right - left) * scale) as usize + 1;
        let rows = ((bottom - top) * scale) as usize + 1;
        let (heads, least) = (vec![NONE; columns * rows], vec![f32::INFINITY; columns * rows]);
        Self { left, top, scale, columns, rows, heads, least }
    }

    /// Adds a member; returns the one before it in its cell.
    #[inline]
    fn insert<const C: usize>(&mut self, index: u32, s: &Sample<C>) -> u32 {
        let (column, row) = self.cell(s);
        let cell = row * self.columns + column;
        self.least[cell] = least(self.least[cell], s.depth);
        std::mem::replace(&mut self.heads[cell], index)
    }

    /// Spreads the least depths over the nine cells around each: first along the rows, then down the
    /// columns.
    fn with_neighbours(mut self) -> Self {
        let columns = self.columns;
        let mut along = self.least.clone();
        for (wide, row) in along.chunks_exact_mut(columns).zip(self.least.chunks_exact(columns)) {
            wide.iter_mut().skip(1).zip(row).for_each(|(w, before)| *w = least(*w, *before));
            wide.iter_mut().zip(&row[1..]).for_each(|(w, after)| *w = least(*w, *after));
        }
        self.least.copy_from_slice(&along);
        self.least.iter_mut().skip(columns).zip(&along).for_each(|(l, above)| *l = least(*l, *above));
        self.least.iter_mut().zip(&along[columns..]).for_each(|(l, below)| *l = least(*l, *below));
        self
    }

    /// Column and row of the cell of a sample.
    #[inline]
    fn cell<const C: usize>(&self, s: &Sample<C>) -> (usize, usize) {
        (((s.x - self.left) * self.scale) as usize, ((s.y - self.top) * self.scale) as usize)
    }

    /// Whether any member hides `s`.
    #[inline]
    fn hides<const C: usize>(&self, s: &Sample<C>, members: &Members<'_, C>) -> bool {
        let (column, row) = self.cell(s);
        let least = self.least[row * self.columns + column];
        members.test.hides(f64::from(least), f64::from(s.depth)) && self.search(s, (column, row), members)
    }

    /// The same by comparison with the members of the nine cells around.
    fn search<const C: usize>(
        &self,
        s: &Sample<C>,
        (column, row): (usize, usize),
        members: &Members<'_, C>,
    ) -> bool {
        let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
        (row.saturating_sub(1)..(row + 2).min(self.rows))
            .any(|r| columns.clone().any(|c| members.hide(self.heads[r * self.columns + c], s)))
    }
}

impl<const C: usize> Members<'_, C> {
    /// Whether a sample of the list that begins with `head` hides `s`.
    fn hide(&self, head: u32, s: &Sample<C>) -> bool {
        let member = |i: u32| (i != NONE).then_some(i);
        std::iter::successors(member(head), |i| member(self.next[*i as usize])).any(|i| {
            let y = &self.samples[i as usize];
            self.test.hides(f64::from(y.depth), f64::from(s.depth))
                && DepthTest::close(s.x - y.x, s.y - y.y, self.test.radius(y.spacing))
        })
    }
}

/// The lesser of two numbers, the first if the second is not a number.
#[inline]
fn least(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

#[cfg(test)]
mod tests {
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
    }

    #[test]
    fn exactly_on_the_circle_counts() {
        let test = DepthTest { epsilon: 5.0, relative: 0.0, absolute: 1.0 };
        let mut pair = vec![sample(0.0, 0.0, -3.0), sample(3.0, 4.0, -2.0), sample(3.0, 4.1, -2.0)];
        assert_eq!(remove(&mut pair, &test), 1);
        assert_eq!(pair.len(), 2);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn equal_to_the_definition(
            raw in prop::collection::vec((-20.0..20.0_f64, -3.0..9.0_f64, 0.5..9.0_f32, 0.2..12.0_f32), 0..150),
            coarse: bool, wide: bool, epsilon in 0.1..4.0_f64, relative in 0.0..0.3_f64, lift in -20.0..5.0_f32
        ) {
            let position = |x: f64| if coarse { (x * 2.0).round() / 2.0 } else { x };
            let samples: Vec<Sample<1>> = raw
                .iter()
                .map(|(x, y, d, spacing)| {
                    let depth = if coarse { d.round() } else { *d };
                    Sample { spacing: if wide { *spacing } else { 1.0 }, ..sample(position(*x), position(*y), depth) }
                })
                .collect();
            check(&samples, &DepthTest { epsilon: position(epsilon).max(0.5), relative, absolute: 0.1 });
            // Signed keys, as chi gives them, with an absolute threshold.
            let signed: Vec<Sample<1>> =
                samples.iter().map(|s| Sample { depth: s.depth + lift, ..*s }).collect();
            check(&signed, &DepthTest { epsilon, relative: 0.0, absolute: 0.5 });
        }
    }
}
