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
pub(crate) mod tests {
    use super::*;
    use crate::depth::Origin;
    use crate::sample::Sample;
    use proptest::prelude::*;

    /// Which samples are hidden.
    fn hidden<const C: usize>(samples: &[Sample<C>], test: &DepthTest) -> Vec<bool> {
        let points = Points::of(samples.iter().copied());
        let mut flags = vec![false; samples.len()];
        PlaneSearch::default().hidden(&points, test).iter().for_each(|i| flags[*i as usize] = true);
        flags
    }

    /// Removes the hidden samples and keeps the order of the others; returns how many were removed.
    pub(crate) fn remove<const C: usize>(samples: &mut Vec<Sample<C>>, test: &DepthTest) -> usize {
        let (before, hidden) = (samples.len(), hidden(samples, test));
        let mut hidden = hidden.iter();
        samples.retain(|_| !hidden.next().unwrap());
        before - samples.len()
    }

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

    /// Many samples in few cells, at few places or at all different ones: the trees decide as the
    /// definition.
    #[test]
    fn a_crowd_hides_as_the_definition_says() {
        let part = |k: usize, step: f64| (k as f64 * step).fract();
        for (places, spread) in [(1.0, 1.0), (4.0, 1.0), (1e9, 1.0), (1e9, 0.01)] {
            let at = |v: f64| (v * places).floor() / places * spread * 5.0;
            let crowd = |k: usize| Sample {
                spacing: (1.0 + 9.0 * part(k, 0.569_840_291)) as f32,
                ..sample(at(part(k, 0.754_877_666)), at(part(k, 0.618_033_989)), 1.0 + part(k, 0.437) as f32)
            };
            let samples: Vec<Sample<1>> = (0..3000).map(crowd).collect();
            for epsilon in [0.02, 0.7] {
                check(&samples, &DepthTest { epsilon, ..DepthTest::default() });
            }
        }
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
                    let origin = if *spacing > 9.0 { Origin::Filled } else { Origin::Known };
                    let spacing = if wide { *spacing } else { 1.0 };
                    Sample { spacing, origin, ..sample(position(*x), position(*y), depth) }
                })
                .collect();
            check(&samples, &DepthTest { epsilon: position(epsilon).max(0.5), relative, absolute: 0.1, parallax });
            // Signed keys, as chi gives them, with an absolute threshold.
            let signed: Vec<Sample<1>> =
                samples.iter().map(|s| Sample { depth: s.depth + lift, ..*s }).collect();
            check(&signed, &DepthTest { epsilon, relative: 0.0, absolute: 0.5, parallax: 0.0 });
        }

        /// Samples that only hide others, places without a sample, and memory used before.
        #[test]
        fn a_search_decides_on_its_own_samples(
            raw in prop::collection::vec((0.0..30.0_f64, 0.0..9.0_f64, 0.5..9.0_f32, 0.2..12.0_f32, 0..4), 1..300),
            epsilon in 0.1..4.0_f64, relative in 0.0..0.3_f64
        ) {
            let samples: Vec<Sample<1>> = raw
                .iter()
                .map(|(x, y, d, spacing, kind)| match kind {
                    0 => Sample { spacing: f32::NAN, ..sample(f64::NAN, f64::NAN, f32::NAN) },
                    _ => Sample { spacing: *spacing, ..sample(*x, *y, *d) },
                })
                .collect();
            let test = DepthTest { epsilon, relative, absolute: 0.1, parallax: 0.0 };
            let mut points = Points::of(samples.iter().copied());
            raw.iter().enumerate().for_each(|(i, s)| points.own[i] = s.4 > 1);
            let own = |i: &usize| points.own[*i];
            let hidden = test.hidden_by_definition(&samples);
            let want: Vec<u32> = (0..raw.len()).filter(|i| hidden[*i]).filter(own).map(|i| i as u32).collect();
            let mut search = PlaneSearch::default();
            for _ in 0..2 {
                prop_assert_eq!(search.hidden(&points, &test), &want);
            }
        }
    }
}
