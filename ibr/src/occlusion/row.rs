//! Occlusion removal within one row: sort by column, then a sliding minimum of the depth.

use super::DepthTest;
use crate::sample::Sample;

/// Work memory of the row routines, reused from row to row.
#[derive(Debug, Clone)]
pub struct RowScratch<const C: usize> {
    sorted: Vec<Sample<C>>,
    starts: Vec<u32>,
    /// Indices of the window whose depths increase; the front is the nearest.
    window: Vec<u32>,
    keep: Vec<bool>,
}

impl<const C: usize> Default for RowScratch<C> {
    fn default() -> Self {
        Self { sorted: Vec::new(), starts: Vec::new(), window: Vec::new(), keep: Vec::new() }
    }
}

impl<const C: usize> RowScratch<C> {
    /// Sorts the samples by column, equal columns in the order given. Expected O(n): a counting sort into
    /// pixels, then insertion, which meets few samples a pixel.
    fn sort(&mut self, samples: &mut Vec<Sample<C>>) {
        let (low, high) = samples.iter().fold((f64::MAX, f64::MIN), |(a, b), s| (a.min(s.x), b.max(s.x)));
        let cells = ((high - low).floor() as usize).saturating_add(1);
        if samples.len() < 2 {
            return;
        }
        if cells > 8 * samples.len() + 64 {
            samples.sort_by(|a, b| a.x.total_cmp(&b.x));
            return;
        }
        let cell = |s: &Sample<C>| (s.x - low) as usize;
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        samples.iter().for_each(|s| self.starts[cell(s) + 1] += 1);
        for i in 0..cells {
            self.starts[i + 1] += self.starts[i];
        }
        self.sorted.clear();
        self.sorted.resize(samples.len(), Sample::BLANK);
        for s in samples.iter() {
            let place = &mut self.starts[cell(s)];
            self.sorted[*place as usize] = *s;
            *place += 1;
        }
        // After the scatter starts[i] is the end of cell i.
        let mut begin = 0;
        for i in 0..cells {
            let end = self.starts[i] as usize;
            sort_cell(&mut self.sorted[begin..end]);
            begin = end;
        }
        std::mem::swap(&mut self.sorted, samples);
    }
}

/// Insertion sort for the usual handful, the library's stable sort for crowds.
fn sort_cell<const C: usize>(cell: &mut [Sample<C>]) {
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

/// Sorts the samples of one row by column and removes the hidden ones; returns how many those were.
///
/// All samples count as lying on one line: their `y` is not looked at. O(n log n) at worst, O(n) as
/// images go; the work memory grows to the longest row and stays.
pub fn remove_in_row<const C: usize>(
    samples: &mut Vec<Sample<C>>,
    test: &DepthTest,
    scratch: &mut RowScratch<C>,
) -> usize {
    scratch.sort(samples);
    scratch.keep.clear();
    scratch.window.clear();
    let (mut head, mut next) = (0, 0);
    for s in samples.iter() {
        while next < samples.len() && (samples[next].x <= s.x || test.close(samples[next].x - s.x, 0.0)) {
            let depth = samples[next].depth;
            while scratch.window.len() > head
                && samples[scratch.window[scratch.window.len() - 1] as usize].depth >= depth
            {
                scratch.window.pop();
            }
            scratch.window.push(next as u32);
            next += 1;
        }
        let close = |i: &u32| test.close(s.x - samples[*i as usize].x, 0.0);
        head += scratch.window[head..].iter().position(close).unwrap_or(0);
        // A place that is no number is close to nothing, not even to itself, and stays.
        let nearest = scratch.window.get(head).filter(|i| close(i)).map(|i| samples[*i as usize].depth);
        scratch.keep.push(nearest.is_none_or(|n| !test.hides(f64::from(n), f64::from(s.depth))));
    }
    let before = samples.len();
    let mut keep = scratch.keep.iter();
    samples.retain(|_| *keep.next().unwrap_or(&true));
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
    fn places_that_are_no_numbers_do_no_harm() {
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
            raw in prop::collection::vec((0.0..40.0_f64, 0.5..9.0_f32), 0..120),
            coarse: bool, epsilon in 0.1..3.0_f64, relative in 0.0..0.3_f64
        ) {
            let place = |x: f64| if coarse { (x * 4.0).round() / 4.0 } else { x };
            let depth = |d: f32| if coarse { d.round().max(1.0) } else { d };
            let samples: Vec<Sample<1>> = raw
                .iter()
                .enumerate()
                .map(|(i, (x, d))| sample(place(*x), depth(*d), i as u32))
                .collect();
            let epsilon = place(epsilon).max(0.25);
            let test = DepthTest { epsilon, relative, absolute: 0.1 };
            let mut scratch = RowScratch::default();
            check(&samples, &test, &mut scratch);
            check(&samples, &test, &mut scratch);
        }
    }
}
