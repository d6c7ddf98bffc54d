//! Occlusion removal within one row: sort by column, then a sliding minimum of the depth.

use super::DepthTest;
use crate::sample::Sample;

/// The part of a sample that sorting and the depth test need: 16 bytes to move instead of 40.
#[derive(Debug, Clone, Copy, Default)]
struct Key {
    x: f64,
    depth: f32,
    /// Index of the sample in the order given.
    index: u32,
}

/// Work memory of the row routines, reused from row to row.
#[derive(Debug, Clone)]
pub struct RowScratch<const C: usize> {
    keys: Vec<Key>,
    sorted: Vec<Key>,
    starts: Vec<u32>,
    /// Indices of the window whose depths increase; the front is the nearest.
    window: Vec<u32>,
    /// Keys that a sample of enlarged radius hides.
    hidden: Vec<bool>,
    survivors: Vec<Sample<C>>,
}

impl<const C: usize> Default for RowScratch<C> {
    fn default() -> Self {
        let (keys, sorted, survivors) = (Vec::new(), Vec::new(), Vec::new());
        Self { keys, sorted, starts: Vec::new(), window: Vec::new(), hidden: Vec::new(), survivors }
    }
}

impl<const C: usize> RowScratch<C> {
    /// Sorts the keys by column, equal columns in the order given. Expected O(n): a counting sort into
    /// pixels, then insertion, which meets few samples per pixel.
    fn sort(&mut self) {
        let n = self.keys.len();
        let (low, high) = self.keys.iter().fold((f64::MAX, f64::MIN), |(a, b), k| (a.min(k.x), b.max(k.x)));
        let cells = ((high - low).floor() as usize).saturating_add(1);
        if n < 2 {
            return;
        }
        if cells > 8 * n + 64 {
            self.keys.sort_by(|a, b| a.x.total_cmp(&b.x));
            return;
        }
        let cell = |k: &Key| (k.x - low) as usize;
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        self.keys.iter().for_each(|k| self.starts[cell(k) + 1] += 1);
        for i in 0..cells {
            self.starts[i + 1] += self.starts[i];
        }
        // All n elements are written below.
        self.sorted.resize(n, Key::default());
        for k in &self.keys {
            let next = &mut self.starts[cell(k)];
            self.sorted[*next as usize] = *k;
            *next += 1;
        }
        // After the scatter starts[i] is the end of cell i.
        let mut begin = 0;
        for end in &self.starts[..cells] {
            let end = *end as usize;
            sort_cell(&mut self.sorted[begin..end]);
            begin = end;
        }
        std::mem::swap(&mut self.sorted, &mut self.keys);
    }

    /// Marks what samples of a larger radius than epsilon hide; the sweep covers the radius epsilon.
    fn mark_hidden(&mut self, samples: &[Sample<C>], test: &DepthTest) {
        let Self { keys, hidden, .. } = self;
        hidden.clear();
        hidden.resize(keys.len(), false);
        for (i, k) in keys.iter().enumerate() {
            let radius = test.radius(samples[k.index as usize].spacing);
            if radius > test.epsilon {
                let close = |other: &Key| DepthTest::close(other.x - k.x, 0.0, radius);
                let behind = |other: &Key| test.hides(f64::from(k.depth), f64::from(other.depth));
                let before = (0..i).rev().take_while(|j| close(&keys[*j]));
                let after = (i + 1..keys.len()).take_while(|j| close(&keys[*j]));
                before.chain(after).filter(|j| behind(&keys[*j])).for_each(|j| hidden[j] = true);
            }
        }
    }

    /// Collects the survivors in the order of the keys, with a window of the nearest keys within epsilon.
    fn sweep(&mut self, samples: &[Sample<C>], test: &DepthTest) {
        let Self { keys, window, hidden, survivors, .. } = self;
        let test_close = |dx: f64| DepthTest::close(dx, 0.0, test.epsilon);
        survivors.clear();
        survivors.reserve(samples.len());
        window.clear();
        let (mut head, mut next) = (0, 0);
        for (k, hidden) in keys.iter().zip(hidden.iter()) {
            while let Some(entering) = keys.get(next).filter(|e| e.x <= k.x || test_close(e.x - k.x)) {
                while window.len() > head && keys[window[window.len() - 1] as usize].depth >= entering.depth {
                    window.pop();
                }
                window.push(next as u32);
                next += 1;
            }
            let close = |i: &u32| test_close(k.x - keys[*i as usize].x);
            head += window[head..].iter().position(close).unwrap_or(0);
            // A NaN position is close to nothing, not even to itself, so the sample is kept.
            let nearest = window.get(head).filter(|i| close(i)).map(|i| keys[*i as usize].depth);
            if !hidden && nearest.is_none_or(|n| !test.hides(f64::from(n), f64::from(k.depth))) {
                survivors.push(samples[k.index as usize]);
            }
        }
    }
}

/// Insertion sort for few samples, the library's stable sort for many.
fn sort_cell(cell: &mut [Key]) {
    if cell.len() > 24 {
        cell.sort_by(|a, b| a.x.total_cmp(&b.x));
        return;
    }
    for i in 1..cell.len() {
        let mut j = i;
        while j > 0 && cell[j - 1].x > cell[j].x {
            cell.swap(j - 1, j);
            j -= 1;
        }
    }
}

/// Sorts the samples of one row by column and removes the hidden ones; returns their number.
///
/// All samples count as lying on one line: their `y` is ignored. O(n log n) at worst, O(n) for
/// typical images; the work memory grows to the longest row and is kept.
pub fn remove_in_row<const C: usize>(
    samples: &mut Vec<Sample<C>>,
    test: &DepthTest,
    scratch: &mut RowScratch<C>,
) -> usize {
    let before = samples.len();
    let key = |(i, s): (usize, &Sample<C>)| Key { x: s.x, depth: s.depth, index: i as u32 };
    scratch.keys.clear();
    scratch.keys.extend(samples.iter().enumerate().map(key));
    scratch.sort();
    scratch.mark_hidden(samples, test);
    scratch.sweep(samples, test);
    std::mem::swap(&mut scratch.survivors, samples);
    before - samples.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample(x: f64, depth: f32, pixel: u32) -> Sample<1> {
        Sample { x, depth, pixel, ..Sample::BLANK }
    }

    fn check(samples: &[Sample<1>], test: &DepthTest, scratch: &mut RowScratch<1>) {
        let hidden = test.hidden_by_definition(samples);
        let mut want: Vec<Sample<1>> =
            samples.iter().zip(&hidden).filter(|(_, h)| !**h).map(|(s, _)| *s).collect();
        want.sort_by(|a, b| a.x.total_cmp(&b.x));
        let mut got = samples.to_vec();
        let removed = remove_in_row(&mut got, test, scratch);
        assert_eq!(got, want);
        assert_eq!(removed, samples.len() - want.len());
    }

    #[test]
    fn empty_and_single_rows() {
        let (test, mut scratch) = (DepthTest::default(), RowScratch::default());
        check(&[], &test, &mut scratch);
        check(&[sample(3.0, 1.0, 0)], &test, &mut scratch);
    }

    #[test]
    fn samples_hide_also_if_they_are_hidden_themselves() {
        // 3 is hidden by 2 although 2 is hidden by 1, which is too far from 3.
        let test = DepthTest { epsilon: 1.0, relative: 0.1, absolute: 0.0 };
        let mut row = vec![sample(0.0, 1.0, 1), sample(0.9, 2.0, 2), sample(1.8, 3.0, 3)];
        assert_eq!(remove_in_row(&mut row, &test, &mut RowScratch::default()), 2);
        assert_eq!(row[0].pixel, 1);
    }

    #[test]
    fn positions_that_are_not_finite_are_harmless() {
        let test = DepthTest::default();
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut row =
                vec![sample(1.0, 1.0, 1), sample(x, 1.0, 2), sample(1.2, 5.0, 3), sample(x, 2.0, 4)];
            remove_in_row(&mut row, &test, &mut RowScratch::default());
            assert!(row.iter().any(|s| s.pixel == 1) && row.len() >= 2, "{row:?}");
            let mut alone = vec![sample(x, 1.0, 1)];
            assert_eq!(remove_in_row(&mut alone, &test, &mut RowScratch::default()), 0);
        }
    }

    #[test]
    fn far_apart_and_crowded_rows() {
        let test = DepthTest { epsilon: 0.6, relative: 0.05, absolute: 0.0 };
        let mut scratch = RowScratch::default();
        let spread: Vec<Sample<1>> = (0..50).map(|i| sample(1e6 * ((i * 31) % 50) as f64, 1.0, i)).collect();
        check(&spread, &test, &mut scratch);
        let crowd: Vec<Sample<1>> =
            (0..200).map(|i| sample(((i * 37) % 90) as f64 * 0.01, 1.0 + ((i * 13) % 7) as f32, i)).collect();
        check(&crowd, &test, &mut scratch);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn equal_to_the_definition(
            raw in prop::collection::vec((0.0..40.0_f64, 0.5..9.0_f32, 0.2..12.0_f32), 0..120),
            coarse: bool, wide: bool, epsilon in 0.1..3.0_f64, relative in 0.0..0.3_f64
        ) {
            let position = |x: f64| if coarse { (x * 4.0).round() / 4.0 } else { x };
            let depth = |d: f32| if coarse { d.round().max(1.0) } else { d };
            let samples: Vec<Sample<1>> = raw
                .iter()
                .enumerate()
                .map(|(i, (x, d, spacing))| Sample {
                    spacing: if wide { *spacing } else { 1.0 },
                    ..sample(position(*x), depth(*d), i as u32)
                })
                .collect();
            let epsilon = position(epsilon).max(0.25);
            let test = DepthTest { epsilon, relative, absolute: 0.1 };
            let mut scratch = RowScratch::default();
            check(&samples, &test, &mut scratch);
            check(&samples, &test, &mut scratch);
        }
    }
}
