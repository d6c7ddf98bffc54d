//! Independent errors of the depth maps, from the maps alone: points that one map gives are looked up in
//! another.

use crate::depth::{DepthMap, FAR, Measure};
use crate::surfaces::DepthTest;

/// Every so many pixels of a map are looked up.
const LOOKUP_STEP: usize = 7;

/// Fewest points for a verdict.
pub(super) const FEWEST_POINTS: usize = 100;

/// The median of |x| of a normal variable of deviation one, to its inverse.
pub(crate) const DEVIATION_PER_MEDIAN: f64 = 1.4826;

/// Differences beyond this many deviations belong to points that another surface hides.
const HIDDEN_BEYOND: f64 = 3.0;

/// Least value of 1 - k1 k2, see [`of_each`]; 5/9 at random places in a row.
const LEAST_AVERAGED: f64 = 0.3;

const ROUNDS: usize = 4;

/// What the lookups of one map in another found.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Lookups {
    /// |difference| of each point: pixels of disparity for a baseline of one, or shares of the depth.
    differences: Vec<f64>,
    /// Sum over the points of the share of the variance that interpolation leaves: the squared weights.
    kept: f64,
}

impl Lookups {
    /// Depths of points of one map against those of another at the same points. `map` takes a pixel and its
    /// depth to the other view.
    pub(crate) fn of(from: &DepthMap, to: &DepthMap, map: impl Fn(f64, f64, f64) -> (f64, f64, f64)) -> Self {
        let (width, height) = from.size();
        let mut all =
            Self { differences: Vec::with_capacity((width * height).div_ceil(LOOKUP_STEP)), kept: 0.0 };
        let is_measured = |p: &usize| !from.is_guessed(*p) && from.data()[*p] < FAR;
        for p in (0..width * height).step_by(LOOKUP_STEP).filter(is_measured) {
            let depth = f64::from(from.data()[p]);
            let (u, v, d) = map((p % width) as f64, (p / width) as f64, depth);
            let Some((there, kept)) = interpolated(to, u, v) else { continue };
            let (difference, is_hidden) = match from.measure() {
                Measure::Disparity => ((there - d).abs(), false),
                Measure::Depth => {
                    ((there / d - 1.0).abs(), !DepthTest::are_one_point(d as f32, there as f32, to))
                }
            };
            if difference.is_finite() && !is_hidden {
                all.differences.push(difference);
                all.kept += kept;
            }
        }
        all
    }

    pub(crate) fn and(mut self, other: Self) -> Self {
        self.differences.extend(other.differences);
        self.kept += other.kept;
        self
    }

    /// Mean share of the variance of the second depth that interpolation leaves: 2/3 between two neighbours,
    /// 4/9 between four, at random places.
    fn share(&self) -> f64 {
        self.kept / self.differences.len().max(1) as f64
    }

    /// Standard deviation of the independent errors of each map, if both have the same: the difference has
    /// s^2 (1 + k), with the share k that interpolation leaves. The median makes hidden points harmless. 0
    /// without points.
    pub(crate) fn common(mut self) -> f64 {
        let share = self.share();
        median(&mut self.differences)
            .map_or(0.0, |median| DEVIATION_PER_MEDIAN * median / (1.0 + share).sqrt())
    }

    /// Variance of the differences without hidden points: the median, again without what lies far beyond it.
    fn variance(&mut self) -> Option<f64> {
        for _ in 0..ROUNDS {
            let limit = HIDDEN_BEYOND * DEVIATION_PER_MEDIAN * median(&mut self.differences)?;
            self.differences.retain(|difference| *difference <= limit);
        }
        Some((DEVIATION_PER_MEDIAN * median(&mut self.differences)?).powi(2))
    }
}

/// The value between pixels of a map, whose neighbours must be measured, and the sum of the squared weights.
fn interpolated(map: &DepthMap, u: f64, v: f64) -> Option<(f64, f64)> {
    let (width, height) = map.size();
    // Also false for positions of pixels without depth.
    if !(u >= 0.0 && v >= 0.0 && u < width as f64 - 1.0 && v <= height as f64 - 1.0) {
        return None;
    }
    let (x, y, s, t) = (u as usize, v as usize, u.fract(), v.fract());
    let known = |p: usize| (!map.is_guessed(p)).then(|| f64::from(map.data()[p]));
    let along = |y: usize| Some(known(y * width + x)? * (1.0 - s) + known(y * width + x + 1)? * s);
    let value = if t == 0.0 { along(y)? } else { along(y)? * (1.0 - t) + along(y + 1)? * t };
    let kept = |part: f64| (1.0 - part).powi(2) + part * part;
    Some((value, kept(s) * kept(t)))
}

pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Variances of the independent errors of two maps, from the lookups of the first in the second and of the
/// second in the first; `None` with too few of them.
///
/// The lookups of the first have the variance D1 = s1^2 + k1 s2^2, because the second depth is interpolated,
/// and those of the second D2 = s2^2 + k2 s1^2. So s1^2 = (D1 - k1 D2) / (1 - k1 k2). Errors that do not
/// change from pixel to pixel are not averaged by interpolation; they have D1 = D2 and are shared equally.
/// `None` too where most points fall on pixels, and nothing is averaged.
pub(super) fn of_each([mut first, mut second]: [Lookups; 2]) -> Option<[f64; 2]> {
    if first.differences.len().min(second.differences.len()) < FEWEST_POINTS {
        return None;
    }
    let (k1, k2) = (first.share(), second.share());
    let (d1, d2) = (first.variance()?, second.variance()?);
    let both = 1.0 - k1 * k2;
    (both >= LEAST_AVERAGED).then(|| [(d1 - k1 * d2) / both, (d2 - k2 * d1) / both].map(|s| s.max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};
    use crate::uncalibrated::random::dice::Dice;

    const SIZE: (usize, usize) = (240, 180);

    fn disturbed(map: &DepthMap, deviation: f64, seed: u64) -> DepthMap {
        let dice = &mut Dice::new(seed);
        let error = |v: f32, e: f64| match map.measure() {
            Measure::Disparity => v + e as f32,
            Measure::Depth => v * (1.0 + e as f32),
        };
        map.changed(|v| error(v, deviation * dice.normal()))
    }

    fn shots() -> [(Camera, DepthMap); 2] {
        [0.0, 1.0].map(|position| {
            let camera = Camera::metric(rig_camera(position, SIZE), false).unwrap();
            (camera, SyntheticScene::default().view(&camera, SIZE).1)
        })
    }

    /// Errors that differ by a factor of eight, and errors in one map alone.
    #[test]
    fn the_errors_of_each_map_are_told_apart() {
        let maps = shots().map(|(_, depth)| rig_disparity(&depth, SIZE.0));
        for deviations in [[0.1, 0.8], [0.5, 0.5], [0.4, 0.0]] {
            let noisy = [0, 1].map(|i| disturbed(&maps[i], deviations[i], 3 + i as u64));
            let look = |a: usize, b: usize| {
                let shift = a as f64 - b as f64;
                Lookups::of(&noisy[a], &noisy[b], move |x, y, d| (x + shift * d, y, d))
            };
            let found = of_each([look(0, 1), look(1, 0)]).unwrap();
            let largest = deviations[0].max(deviations[1]).powi(2);
            for (found, deviation) in found.iter().zip(deviations) {
                assert!((found - deviation * deviation).abs() < 0.2 * largest, "{deviations:?}: {found:?}");
            }
        }
    }

    #[test]
    fn relative_errors_of_depths_are_told_apart() {
        let shots = shots();
        let noisy = [(0, 0.002), (1, 0.008)].map(|(i, s)| disturbed(&shots[i].1, s, 7 + i as u64));
        let look = |a: usize, b: usize| {
            let map = shots[a].0.relative_to(&shots[b].0);
            Lookups::of(&noisy[a], &noisy[b], move |x, y, d| map.map(x, y, d))
        };
        let [first, second] = of_each([look(0, 1), look(1, 0)]).unwrap().map(f64::sqrt);
        assert!((0.0..0.004).contains(&first) && (0.007..0.009).contains(&second), "{first} {second}");
    }

    #[test]
    fn few_points_have_no_verdict() {
        let few = |count| Lookups { differences: vec![1.0; count], kept: 0.6 * count as f64 };
        assert_eq!(of_each([few(99), few(500)]), None);
        assert!(of_each([few(100), few(500)]).is_some());
        assert_eq!(Lookups::default().common(), 0.0);
    }
}
