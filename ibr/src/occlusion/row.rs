//! Occlusion removal within one row: sort by column, then a sliding minimum of the depth.

use super::{DepthTest, hidden};
use crate::lanes::{largest, least};
use crate::sample::Sample;
use std::ops::Range;

/// Added to a number below it, it rounds to a whole one, which is the lower part of the bits of the sum.
const WHOLE: f64 = (1_u64 << 52) as f64;

/// The part of a sample that sorting and the depth test need: 16 bytes to move instead of 40.
#[derive(Debug, Clone, Copy, Default)]
struct Key {
    x: f64,
    depth: f32,
    /// Index of the sample in the order given.
    index: u32,
}

/// So many keys near depth edges are searched as in the plane: comparing each with those within its radius
/// would take a time in proportion to the square of the number of views.
const CROWD: usize = 4096;

/// Keys whose depths are compared as a whole.
const CHUNK: usize = 8;

/// The least and the largest depth of some keys.
#[derive(Debug, Clone, Copy)]
struct Depths {
    near: f32,
    far: f32,
}

impl Depths {
    const NONE: Self = Self { near: f32::INFINITY, far: f32::NEG_INFINITY };

    /// A depth that is not a number hides nothing and is not hidden.
    #[inline]
    fn and(self, other: Self) -> Self {
        Self { near: least(self.near, other.near), far: largest(self.far, other.far) }
    }

    fn of(keys: &[Key]) -> Self {
        keys.iter().fold(Self::NONE, |all, k| all.and(Self { near: k.depth, far: k.depth }))
    }
}

/// Work memory of the row routines, reused from row to row.
#[derive(Debug, Clone, Default)]
pub struct RowScratch<const C: usize> {
    keys: Vec<Key>,
    sorted: Vec<Key>,
    starts: Vec<u32>,
    /// The depths of each chunk of keys.
    chunks: Vec<Depths>,
    /// Indices of the window whose depths increase; the front is the nearest.
    window: Vec<u32>,
    /// Keys that a sample of enlarged radius hides.
    hidden: Vec<bool>,
    survivors: Vec<Sample<C>>,
}

impl<const C: usize> RowScratch<C> {
    /// Sorts the keys by column, equal columns in the order given. Expected O(n): a counting sort into as
    /// many cells as there are keys, then insertion, which meets few keys per cell.
    fn sort(&mut self) {
        let n = self.keys.len();
        if n < 2 {
            return;
        }
        let none = (f64::MAX, f64::MIN);
        let (low, high) = self.keys.iter().fold(none, |(low, high), k| (least(low, k.x), largest(high, k.x)));
        let scale = (n - 1) as f64 / (high - low + 1.0);
        if !(scale.is_finite() && scale > 0.0) {
            self.keys.sort_by(|a, b| a.x.total_cmp(&b.x));
            return;
        }
        // The cast of a sum that has no fraction left: a cast of the number itself tests for its range. The
        // limit is for positions that are not numbers.
        let cell = |k: &Key| (((k.x - low) * scale + WHOLE).to_bits() as u32 as usize).min(n - 1);
        self.starts.clear();
        self.starts.resize(n + 1, 0);
        self.keys.iter().for_each(|k| self.starts[cell(k) + 1] += 1);
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
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
        for end in &self.starts[..n] {
            let end = *end as usize;
            sort_cell(&mut self.sorted[begin..end]);
            begin = end;
        }
        std::mem::swap(&mut self.sorted, &mut self.keys);
    }

    /// Collects the survivors in the order of the keys.
    ///
    /// Within a surface no depths of neighbours are far enough apart for one sample to hide another: then
    /// the least and the largest depth around a chunk of keys show that all of it is visible. Other chunks
    /// are searched.
    fn collect(&mut self, samples: &[Sample<C>], test: &DepthTest) {
        let n = self.keys.len();
        let radius = test.radius(samples.iter().fold(0.0, |most, s| largest(most, s.spacing)));
        self.chunks.clear();
        self.chunks.extend(self.keys.chunks(CHUNK).map(Depths::of));
        self.hidden.clear();
        self.hidden.resize(n, false);
        let (mut chunk, count) = (0, self.chunks.len());
        while chunk < count {
            let start = chunk;
            while chunk < count && self.is_flat(chunk, radius, test) {
                chunk += 1;
            }
            let visible = &self.keys[start * CHUNK..(chunk * CHUNK).min(n)];
            self.survivors.extend(visible.iter().map(|k| samples[k.index as usize]));
            let start = chunk;
            while chunk < count && !self.is_flat(chunk, radius, test) {
                chunk += 1;
            }
            if start < chunk {
                let around = self.around(start..chunk, radius);
                let around = around.start * CHUNK..(around.end * CHUNK).min(n);
                let own = start * CHUNK..(chunk * CHUNK).min(n);
                if around.len() > CROWD {
                    self.search(around, own, samples, test);
                } else {
                    self.mark_hidden(around.clone(), samples, test);
                    self.sweep(around, own, samples, test);
                }
            }
        }
    }

    /// Whether no sample near a chunk can hide another.
    fn is_flat(&self, chunk: usize, radius: f64, test: &DepthTest) -> bool {
        let around = self.around(chunk..chunk + 1, radius);
        let Depths { near, far } = self.chunks[around].iter().fold(Depths::NONE, |all, d| all.and(*d));
        !test.hides(f64::from(near), f64::from(far))
    }

    /// Some chunks and all that have keys within a radius of theirs.
    #[inline]
    fn around(&self, chunks: Range<usize>, radius: f64) -> Range<usize> {
        let (mut start, mut end) = (chunks.start, chunks.end);
        let close = |a: usize, b: usize| DepthTest::close(self.keys[b].x - self.keys[a].x, 0.0, radius);
        let last = (end * CHUNK).min(self.keys.len()) - 1;
        while start > 0 && close(start * CHUNK - 1, chunks.start * CHUNK) {
            start -= 1;
        }
        while end < self.chunks.len() && close(last, end * CHUNK) {
            end += 1;
        }
        start..end
    }

    /// Collects the survivors among the keys `own`, which the keys `around` may hide, as in the plane.
    fn search(&mut self, around: Range<usize>, own: Range<usize>, samples: &[Sample<C>], test: &DepthTest) {
        let Self { keys, survivors, .. } = self;
        let on_line = |k: &Key| Sample { y: 0.0, ..samples[k.index as usize] };
        let hidden = hidden(keys[around.clone()].iter().map(on_line), test);
        let visible = own.filter(|i| !hidden[*i - around.start]);
        survivors.extend(visible.map(|i| samples[keys[i].index as usize]));
    }

    /// Marks what samples of a larger radius than epsilon hide; the sweep covers the radius epsilon.
    fn mark_hidden(&mut self, around: Range<usize>, samples: &[Sample<C>], test: &DepthTest) {
        let (keys, hidden) = (&self.keys[around.clone()], &mut self.hidden[around]);
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

    /// Collects the survivors among the keys `own`, with a window of the nearest keys within epsilon, all of
    /// which lie in `around`.
    fn sweep(&mut self, around: Range<usize>, own: Range<usize>, samples: &[Sample<C>], test: &DepthTest) {
        let Self { keys, window, hidden, survivors, .. } = self;
        let test_close = |dx: f64| DepthTest::close(dx, 0.0, test.epsilon);
        window.clear();
        let (mut head, mut next) = (0, around.start);
        for (k, hidden) in keys[own.clone()].iter().zip(&hidden[own]) {
            while let Some(entering) =
                keys[..around.end].get(next).filter(|e| e.x <= k.x || test_close(e.x - k.x))
            {
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
    // The two lists are exchanged from row to row; both have the place that the next row asks for.
    scratch.survivors.clear();
    scratch.survivors.reserve_exact(samples.capacity());
    scratch.collect(samples, test);
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
        let test = DepthTest { epsilon: 1.0, relative: 0.1, absolute: 0.0, parallax: 0.0 };
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
        let test = DepthTest { epsilon: 0.6, relative: 0.05, absolute: 0.0, parallax: 0.0 };
        let mut scratch = RowScratch::default();
        let spread: Vec<Sample<1>> = (0..50).map(|i| sample(1e6 * ((i * 31) % 50) as f64, 1.0, i)).collect();
        check(&spread, &test, &mut scratch);
        let crowd: Vec<Sample<1>> =
            (0..200).map(|i| sample(((i * 37) % 90) as f64 * 0.01, 1.0 + ((i * 13) % 7) as f32, i)).collect();
        check(&crowd, &test, &mut scratch);
        // As many views as are searched in another way, with radii of one and of several pixels.
        let part = |k: u32, step: f64| (f64::from(k) * step).fract();
        for spacing in [0.0, 5.0] {
            let view = |k: u32| Sample {
                spacing: (1.0 + spacing * part(k, 0.569_840_291)) as f32,
                ..sample(9.0 * part(k, 0.754_877_666), 1.0 + part(k, 0.618_033_989) as f32, k)
            };
            let crowd: Vec<Sample<1>> = (0..2 * CROWD as u32).map(view).collect();
            check(&crowd, &test, &mut scratch);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn equal_to_the_definition(
            raw in prop::collection::vec((0.0..40.0_f64, 0.5..9.0_f32, 0.2..12.0_f32), 0..120),
            coarse: bool, wide: bool, epsilon in 0.1..3.0_f64, relative in 0.0..0.3_f64, parallax in 0.0..0.4_f64
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
            let test = DepthTest { epsilon, relative, absolute: 0.1, parallax };
            let mut scratch = RowScratch::default();
            check(&samples, &test, &mut scratch);
            check(&samples, &test, &mut scratch);
        }
    }
}
