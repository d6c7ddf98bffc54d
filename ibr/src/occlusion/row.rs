//! Occlusion removal within one row: the search of the plane, with all samples on a line, and the order by
//! column that the row fit takes.

use super::DepthTest;
use super::grid::PlaneSearch;
use super::points::Points;
use crate::sample::Sample;

/// The part of a sample that sorting needs: 16 bytes to move instead of 48.
#[derive(Debug, Clone, Copy, Default)]
struct Key {
    x: f64,
    index: u32,
}

/// Work memory of the row routines, reused from row to row.
#[derive(Debug, Clone, Default)]
pub struct RowScratch<const C: usize> {
    points: Points,
    search: PlaneSearch,
    keys: Vec<Key>,
    survivors: Vec<Sample<C>>,
}

impl<const C: usize> RowScratch<C> {
    fn find_visible(&mut self, samples: &[Sample<C>], test: &DepthTest) {
        let Self { points, search, keys, .. } = self;
        points.set(samples.iter().map(|s| Sample { y: 0.0, ..*s }));
        let mut hidden = search.hidden(points, test).iter().peekable();
        let all = samples.iter().zip(0_u32..);
        let visible = all.filter(|(_, index)| hidden.next_if_eq(&index).is_none());
        keys.clear();
        keys.extend(visible.map(|(s, index)| Key { x: s.x, index }));
    }

    /// Sorts the keys by column, equal columns in the order given.
    fn sort(&mut self) {
        self.keys.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.index.cmp(&b.index)));
    }
}

/// Sorts the samples of one row by column and removes the hidden ones; returns their number.
///
/// All samples count as lying on one line: their `y` is ignored. O(n log n); the work memory grows to the
/// longest row and is kept.
pub fn remove_in_row<const C: usize>(
    samples: &mut Vec<Sample<C>>,
    test: &DepthTest,
    scratch: &mut RowScratch<C>,
) -> usize {
    let before = samples.len();
    scratch.find_visible(samples, test);
    scratch.sort();
    let RowScratch { keys, survivors, .. } = scratch;
    // The two lists are exchanged from row to row; both have the place that the next row asks for.
    survivors.clear();
    survivors.reserve_exact(samples.capacity());
    survivors.extend(keys.iter().map(|k| samples[k.index as usize]));
    std::mem::swap(survivors, samples);
    before - samples.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::Origin;
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
        let test =
            DepthTest { epsilon: 1.0, relative: 0.1, absolute: 0.0, parallax: 0.0, ..DepthTest::default() };
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
        let test =
            DepthTest { epsilon: 0.6, relative: 0.05, absolute: 0.0, parallax: 0.0, ..DepthTest::default() };
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
            let crowd: Vec<Sample<1>> = (0..8192).map(view).collect();
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
                    origin: if *spacing > 9.0 { Origin::Filled } else { Origin::Known },
                    ..sample(position(*x), depth(*d), i as u32)
                })
                .collect();
            let epsilon = position(epsilon).max(0.25);
            let test = DepthTest { epsilon, relative, absolute: 0.1, parallax, ..DepthTest::default() };
            let mut scratch = RowScratch::default();
            check(&samples, &test, &mut scratch);
            check(&samples, &test, &mut scratch);
        }
    }
}
