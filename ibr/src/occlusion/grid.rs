//! Occlusion removal in the plane: a grid of cells of the size of the radius, nearest samples first in each
//! cell.

use super::DepthTest;
use crate::sample::Sample;
use rayon::prelude::*;

/// Most cells per sample, so that a tiny radius on a wide plane does not exhaust the memory.
const CELLS_A_SAMPLE: usize = 4;

/// Removes the hidden samples and keeps the order of the others; returns how many were removed.
///
/// The ball of a sample meets at most nine cells. Each cell lists its samples from the nearest, so the
/// search in it ends at the first sample that lies in the ball or is too deep to hide this one. O(n log n)
/// for the sort, then O(k) per sample, k the number of samples in a cell. Parallel, with the same bits for
/// any number of threads.
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
    let grid = Grid::new(samples, test.epsilon);
    samples.par_iter().with_min_len(4096).map(|s| grid.hides(samples, s, test)).collect()
}

/// Samples sorted into square cells, by increasing depth within a cell.
struct Grid {
    left: f64,
    top: f64,
    edge: f64,
    columns: usize,
    rows: usize,
    /// Start of each cell in `order`, with one entry more than cells.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl Grid {
    fn new<const C: usize>(samples: &[Sample<C>], epsilon: f64) -> Self {
        let bounds = |of: fn(&Sample<C>) -> f64| {
            samples.iter().map(of).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)))
        };
        let ((left, right), (top, bottom)) = (bounds(|s| s.x), bounds(|s| s.y));
        let mut edge = epsilon;
        let limit = (CELLS_A_SAMPLE * samples.len() + 16) as f64;
        // The doubling ends at the latest when one cell holds all samples.
        while ((right - left) / edge + 1.0) * ((bottom - top) / edge + 1.0) > limit {
            edge *= 2.0;
        }
        let columns = ((right - left) / edge) as usize + 1;
        let rows = ((bottom - top) / edge) as usize + 1;
        let mut grid = Self { left, top, edge, columns, rows, starts: Vec::new(), order: Vec::new() };
        grid.distribute(samples);
        grid.sort_cells(samples);
        grid
    }

    /// Counting sort of the indices into the cells.
    fn distribute<const C: usize>(&mut self, samples: &[Sample<C>]) {
        self.starts = vec![0; self.columns * self.rows + 2];
        for s in samples {
            let cell = self.cell(s);
            self.starts[cell + 2] += 1;
        }
        for i in 2..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        self.order = vec![0; samples.len()];
        for (i, s) in samples.iter().enumerate() {
            let cell = self.cell(s);
            let next = &mut self.starts[cell + 1];
            self.order[*next as usize] = i as u32;
            *next += 1;
        }
    }

    fn sort_cells<const C: usize>(&mut self, samples: &[Sample<C>]) {
        let mut cells = Vec::with_capacity(self.columns * self.rows);
        let mut rest = self.order.as_mut_slice();
        for pair in self.starts.windows(2).take(self.columns * self.rows) {
            let (cell, tail) = rest.split_at_mut((pair[1] - pair[0]) as usize);
            cells.push(cell);
            rest = tail;
        }
        let depth = |i: &u32| samples[*i as usize].depth;
        cells
            .par_iter_mut()
            .with_min_len(1024)
            .for_each(|cell| cell.sort_unstable_by(|a, b| depth(a).total_cmp(&depth(b)).then(a.cmp(b))));
    }

    fn cell<const C: usize>(&self, s: &Sample<C>) -> usize {
        let column = ((s.x - self.left) / self.edge) as usize;
        let row = ((s.y - self.top) / self.edge) as usize;
        row * self.columns + column
    }

    /// Whether any sample hides `s`.
    fn hides<const C: usize>(&self, samples: &[Sample<C>], s: &Sample<C>, test: &DepthTest) -> bool {
        // The cell size is at least epsilon, so only neighbouring cells matter; the bound guards against
        // rounding of the quotient.
        let column = ((s.x - self.left) / self.edge) as usize;
        let row = ((s.y - self.top) / self.edge) as usize;
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
            .take_while(|y| test.hides(f64::from(y.depth), f64::from(s.depth)))
            .any(|y| test.close(s.x - y.x, s.y - y.y))
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
            raw in prop::collection::vec((-20.0..20.0_f64, -3.0..9.0_f64, 0.5..9.0_f32), 0..150),
            coarse: bool, epsilon in 0.1..4.0_f64, relative in 0.0..0.3_f64, lift in -20.0..5.0_f32
        ) {
            let position = |x: f64| if coarse { (x * 2.0).round() / 2.0 } else { x };
            let samples: Vec<Sample<1>> = raw
                .iter()
                .map(|(x, y, d)| sample(position(*x), position(*y), if coarse { d.round() } else { *d }))
                .collect();
            check(&samples, &DepthTest { epsilon: position(epsilon).max(0.5), relative, absolute: 0.1 });
            // Signed keys, as chi gives them, with an absolute threshold.
            let signed: Vec<Sample<1>> =
                samples.iter().map(|s| Sample { depth: s.depth + lift, ..*s }).collect();
            check(&signed, &DepthTest { epsilon, relative: 0.0, absolute: 0.5 });
        }
    }
}
