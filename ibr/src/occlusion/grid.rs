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
fn hidden<const C: usize>(samples: &[Sample<C>], test: &DepthTest) -> Vec<bool> {
    if samples.is_empty() {
        return Vec::new();
    }
    let extent = Extent::of(samples);
    let grids: Vec<Grid> = by_radius(samples)
        .into_iter()
        .enumerate()
        .filter(|(_, members)| !members.is_empty())
        .map(|(level, members)| Grid::new(samples, &members, &extent, test.radius((1 << level) as f32)))
        .collect();
    let hidden = |s: &Sample<C>| grids.iter().any(|grid| grid.hides(samples, s, test));
    samples.par_iter().with_min_len(4096).map(hidden).collect()
}

/// Indices of the samples of spacing up to 1, 2, 4 and 8.
fn by_radius<const C: usize>(samples: &[Sample<C>]) -> [Vec<u32>; 4] {
    let mut levels = [const { Vec::new() }; 4];
    for (i, s) in samples.iter().enumerate() {
        let level = [1.0, 2.0, 4.0].iter().filter(|limit| s.spacing > **limit).count();
        levels[level].push(i as u32);
    }
    levels
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
        let bounds = |of: fn(&Sample<C>) -> f64| {
            samples.iter().map(of).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ((left, right), (top, bottom)) = (bounds(|s| s.x), bounds(|s| s.y));
        Self { left, right, top, bottom }
    }
}

/// Samples of similar radius sorted into square cells.
struct Grid {
    left: f64,
    top: f64,
    edge: f64,
    columns: usize,
    rows: usize,
    /// Start of each cell in `order`, with one entry more than cells.
    starts: Vec<u32>,
    order: Vec<u32>,
    /// Least depth of the members in each cell and its eight neighbours.
    least: Vec<f32>,
}

impl Grid {
    /// A grid over the extent of all samples, with the members in cells no smaller than `radius`.
    fn new<const C: usize>(samples: &[Sample<C>], members: &[u32], extent: &Extent, radius: f64) -> Self {
        let Extent { left, right, top, bottom } = *extent;
        let mut edge = radius;
        let limit = (CELLS_A_SAMPLE * samples.len() + 16) as f64;
        // The doubling ends at the latest when one cell holds all samples.
        while ((right - left) / edge + 1.0) * ((bottom - top) / edge + 1.0) > limit {
            edge *= 2.0;
        }
        let columns = ((right - left) / edge) as usize + 1;
        let rows = ((bottom - top) / edge) as usize + 1;
        let (starts, order, least) = (Vec::new(), Vec::new(), Vec::new());
        let mut grid = Self { left, top, edge, columns, rows, starts, order, least };
        grid.distribute(samples, members);
        grid.least = grid.least_around(samples);
        grid
    }

    /// Counting sort of the members into the cells.
    fn distribute<const C: usize>(&mut self, samples: &[Sample<C>], members: &[u32]) {
        self.starts = vec![0; self.columns * self.rows + 2];
        for i in members {
            let cell = self.cell(&samples[*i as usize]);
            self.starts[cell + 2] += 1;
        }
        for i in 2..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        self.order = vec![0; members.len()];
        for i in members {
            let cell = self.cell(&samples[*i as usize]);
            let next = &mut self.starts[cell + 1];
            self.order[*next as usize] = *i;
            *next += 1;
        }
    }

    /// Least depth over the nine cells around each cell: first along the rows, then down the columns.
    fn least_around<const C: usize>(&self, samples: &[Sample<C>]) -> Vec<f32> {
        let mut least = vec![f32::INFINITY; self.columns * self.rows];
        for (cell, bounds) in least.iter_mut().zip(self.starts.windows(2)) {
            let members = &self.order[bounds[0] as usize..bounds[1] as usize];
            *cell = members.iter().fold(f32::INFINITY, |d, i| d.min(samples[*i as usize].depth));
        }
        let of_three = |from: &[f32], at: usize, stride: usize, first: bool, last: bool| {
            let before = if first { f32::INFINITY } else { from[at - stride] };
            let after = if last { f32::INFINITY } else { from[at + stride] };
            from[at].min(before).min(after)
        };
        let (columns, rows) = (self.columns, self.rows);
        let cells = 0..columns * rows;
        let along: Vec<f32> = cells
            .clone()
            .into_par_iter()
            .with_min_len(4096)
            .map(|c| of_three(&least, c, 1, c % columns == 0, (c + 1) % columns == 0))
            .collect();
        cells
            .into_par_iter()
            .with_min_len(4096)
            .map(|c| of_three(&along, c, columns, c < columns, c / columns + 1 == rows))
            .collect()
    }

    fn cell<const C: usize>(&self, s: &Sample<C>) -> usize {
        let column = ((s.x - self.left) / self.edge) as usize;
        let row = ((s.y - self.top) / self.edge) as usize;
        row * self.columns + column
    }

    /// Whether any member hides `s`.
    fn hides<const C: usize>(&self, samples: &[Sample<C>], s: &Sample<C>, test: &DepthTest) -> bool {
        // The cell size is at least the radius, so only neighbouring cells matter; the bound guards against
        // rounding of the quotient.
        let column = ((s.x - self.left) / self.edge) as usize;
        let row = ((s.y - self.top) / self.edge) as usize;
        if !test.hides(f64::from(self.least[row * self.columns + column]), f64::from(s.depth)) {
            return false;
        }
        let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
        (row.saturating_sub(1)..(row + 2).min(self.rows))
            .any(|r| columns.clone().any(|c| self.cell_hides(r * self.columns + c, samples, s, test)))
    }

    fn cell_hides<const C: usize>(
        &self,
        cell: usize,
        samples: &[Sample<C>],
        s: &Sample<C>,
        test: &DepthTest,
    ) -> bool {
        let members = &self.order[self.starts[cell] as usize..self.starts[cell + 1] as usize];
        members
            .iter()
            .map(|i| &samples[*i as usize])
            .filter(|y| test.hides(f64::from(y.depth), f64::from(s.depth)))
            .any(|y| DepthTest::close(s.x - y.x, s.y - y.y, test.radius(y.spacing)))
    }
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
