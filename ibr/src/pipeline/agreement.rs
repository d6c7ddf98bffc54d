//! Whether the inputs fit each other, from the inputs alone: points that one view gives by its depth must
//! lie at the same depth and have the same colour in another view.

use super::depth_errors::{self, FEWEST_POINTS, Lookups};
use crate::depth::{DepthMap, Measure};
use crate::image::{Image, Texture};
use crate::propagate::{Nearest, View, Viewpoint};
use rayon::prelude::*;

/// Pixels of each view that are compared, about.
const COMPARED_PIXELS: usize = 20_000;

/// Depths agree up to this share of the nearer one, disparities also up to one pixel.
const DEPTH_SHARE: f32 = 0.05;

/// Colours agree up to this many grey levels.
const GREY_LEVELS: f32 = 20.0;

/// Exposures that differ by less than this are equal: the estimate has an error too.
const SMALLEST_GAIN: f64 = 0.04;

/// Share of agreeing points below which the inputs are probably wrong.
const LEAST_SHARE: f64 = 0.5;

/// How well two views agree.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PairAgreement {
    /// The two views, by number from 0.
    pub views: [usize; 2],
    /// Points of one view that fall in the image of the other.
    pub points: usize,
    /// Of these, the share that has the same depth and colour there. The rest is hidden in the other view,
    /// or the inputs are wrong: 0.85 to 0.95 for good depth, 0.1 to 0.3 for swapped positions or a missing
    /// scale.
    pub share: f64,
    /// Brightness of the second view divided by that of the first, at points of the same depth.
    pub gain: f64,
    /// Root mean square difference of the brightness at points of the same depth, with equal exposure, grey
    /// levels.
    pub difference: f64,
}

impl PairAgreement {
    /// Whether so few points agree that the inputs are probably wrong.
    pub fn is_poor(&self) -> bool {
        self.share < LEAST_SHARE
    }
}

/// The agreement of all views, each with the closest of those before it.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Agreement {
    /// The pairs that share enough points for a verdict.
    pub pairs: Vec<PairAgreement>,
    /// Factor for each view that gives it the exposure of the first one; 1 where the difference is small.
    pub gains: Vec<f64>,
    /// Noise and slopes of each photograph, where it shows them.
    pub textures: Vec<Option<Texture>>,
    /// Standard deviation of the independent errors of each map: pixels of disparity for a baseline of one,
    /// or shares of the depth. Empty where a view shares too few points with another.
    pub depth_errors: Vec<f64>,
}

impl Agreement {
    /// Of views of one kind.
    pub fn of<P: Viewpoint>(views: &[View<'_, P>]) -> Self {
        let textures = views.par_iter().map(|view| Texture::of(view.image)).collect();
        let mut agreement = Self { gains: vec![1.0; views.len()], textures, ..Self::default() };
        let mut errors = vec![Vec::new(); views.len()];
        let nearest = Nearest::new(views);
        for j in 1..views.len() {
            let Some(i) = nearest.before(j) else { continue };
            let found = Comparison::new(&views[i], &views[j]).verdict([i, j]);
            let Some(pair) = found else { continue };
            // Brightness at points that do not correspond says nothing.
            let gain = if pair.is_poor() { 1.0 } else { pair.gain };
            agreement.gains[j] = agreement.gains[i] / gain;
            agreement.pairs.push(pair);
            let look =
                |a: &View<'_, P>, b: &View<'_, P>| Lookups::of(a.map, b.map, a.camera.map_to(&b.camera));
            let lookups = [look(&views[i], &views[j]), look(&views[j], &views[i])];
            if let Some(found) = depth_errors::of_each(lookups) {
                [i, j].iter().zip(found).for_each(|(view, variance)| errors[*view].push(variance));
            }
        }
        agreement.gains.iter_mut().filter(|g| g.ln().abs() < SMALLEST_GAIN).for_each(|g| *g = 1.0);
        agreement.depth_errors = deviations(&errors).unwrap_or_default();
        agreement
    }

    /// Variance of the noise of a view, with its exposure; 0 if its photograph does not show it.
    pub(super) fn noise(&self, view: usize) -> f64 {
        let texture = self.textures.get(view).copied().flatten();
        let gain = self.gains.get(view).copied().unwrap_or(1.0);
        texture.map_or(0.0, |texture| (texture.noise * gain).powi(2))
    }

    /// Standard deviation of the errors of a map; 0 if it is not known.
    pub(super) fn depth_error(&self, view: usize) -> f64 {
        self.depth_errors.get(view).copied().unwrap_or(0.0)
    }

    /// Variance of what views show differently for other reasons than noise: depth that is not exact, and
    /// surfaces that shine. `None` without pairs.
    pub(super) fn variance(&self) -> Option<f64> {
        // The brightness is the mean of three colours.
        let noise = |pair: &PairAgreement| pair.views.map(|view| self.noise(view)).iter().sum::<f64>() / 3.0;
        let all: f64 = self.pairs.iter().map(|pair| (pair.difference.powi(2) - noise(pair)).max(0.0)).sum();
        (!self.pairs.is_empty()).then(|| all / self.pairs.len() as f64)
    }

    /// The pair that agrees least.
    pub fn worst(&self) -> Option<&PairAgreement> {
        self.pairs.iter().min_by(|a, b| a.share.total_cmp(&b.share))
    }
}

/// Roots of the mean variances found for each map; `None` if one has none.
fn deviations(variances: &[Vec<f64>]) -> Option<Vec<f64>> {
    let mean = |found: &Vec<f64>| {
        (!found.is_empty()).then(|| (found.iter().sum::<f64>() / found.len() as f64).sqrt())
    };
    variances.iter().map(mean).collect()
}

/// Points of one view found in another one.
struct Comparison {
    points: usize,
    /// Brightness in both views of the points at which the depths agree.
    matched: Vec<[f32; 2]>,
}

impl Comparison {
    fn new<P: Viewpoint>(first: &View<'_, P>, second: &View<'_, P>) -> Self {
        let (image, other, other_map) = (first.image, second.image, second.map);
        let to_second = first.camera.map_to(&second.camera);
        let (width, height) = image.size();
        let step = ((width * height / COMPARED_PIXELS) as f64).sqrt().ceil().max(1.0) as usize;
        let rows: Vec<usize> = (0..height).step_by(step).collect();
        let of_row = |y: &usize| {
            let mut all = Self { points: 0, matched: Vec::new() };
            for x in (0..width).step_by(step) {
                let (u, v, d) = to_second(x as f64, *y as f64, f64::from(first.map.row(*y)[x]));
                let inside = |v: f64, side: usize| v > -0.5 && v < side as f64 - 0.5;
                // False for NaN, hence for pixels without depth.
                if !(inside(u, other.width()) && inside(v, other.height())) {
                    continue;
                }
                let (column, row) = ((u + 0.5) as usize, (v + 0.5) as usize);
                let there = other_map.row(row)[column];
                if there.is_nan() {
                    continue;
                }
                all.points += 1;
                if same_depth(d as f32, there, other_map) {
                    let q = row * other.width() + column;
                    all.matched.push([brightness(image, y * width + x), brightness(other, q)]);
                }
            }
            all
        };
        let parts: Vec<Self> = rows.par_iter().with_min_len(16).map(of_row).collect();
        let points = parts.iter().map(|part| part.points).sum();
        Self { points, matched: parts.into_iter().flat_map(|part| part.matched).collect() }
    }

    fn verdict(&self, views: [usize; 2]) -> Option<PairAgreement> {
        if self.points < FEWEST_POINTS {
            return None;
        }
        let gain = self.gain();
        let alike = |[a, b]: &&[f32; 2]| (b - a * gain as f32).abs() <= GREY_LEVELS;
        let share = self.matched.iter().filter(alike).count() as f64 / self.points as f64;
        Some(PairAgreement { views, points: self.points, share, gain, difference: self.difference(gain) })
    }

    fn difference(&self, gain: f64) -> f64 {
        let square = |[a, b]: &[f32; 2]| (f64::from(*b) / gain - f64::from(*a)).powi(2);
        (self.matched.iter().map(square).sum::<f64>() / self.matched.len().max(1) as f64).sqrt()
    }

    /// The median ratio of the brightness of points that are neither dark nor overexposed; 1 of too few.
    fn gain(&self) -> f64 {
        let usable = |v: f32| (16.0..250.0).contains(&v);
        let both = self.matched.iter().filter(|[a, b]| usable(*a) && usable(*b));
        let mut ratios: Vec<f64> = both.map(|[a, b]| f64::from(*b) / f64::from(*a)).collect();
        if ratios.len() < FEWEST_POINTS { 1.0 } else { depth_errors::median(&mut ratios).unwrap_or(1.0) }
    }
}

fn same_depth(a: f32, b: f32, map: &DepthMap) -> bool {
    let tolerance = match map.measure() {
        Measure::Disparity => (DEPTH_SHARE * (a.min(b) + map.offset() as f32)).max(1.0),
        Measure::Depth => DEPTH_SHARE * a.min(b),
    };
    (a - b).abs() <= tolerance
}

fn brightness(image: &Image, pixel: usize) -> f32 {
    image.pixel::<3>(pixel).iter().sum::<f32>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::propagate::{CalibratedView, RectifiedView};
    use crate::synthetic::{SyntheticScene, rig_camera, rig_disparity};

    const SIZE: (usize, usize) = (160, 120);

    fn record(position: f64) -> (Image, DepthMap) {
        let camera = Camera::metric(rig_camera(position, SIZE), false).unwrap();
        SyntheticScene::default().view(&camera, SIZE)
    }

    fn scaled(map: &DepthMap, factor: f32) -> DepthMap {
        let values = map.data().iter().map(|v| v * factor).collect();
        DepthMap::new(map.size(), values, 1.0, map.measure()).unwrap()
    }

    #[test]
    fn wrong_inputs_agree_in_few_points() {
        let shots = [0.0, 1.0].map(record);
        let disparities = shots.each_ref().map(|s| rig_disparity(&s.1, SIZE.0));
        let share = |positions: [f64; 2], factor: f32| {
            let maps = disparities.each_ref().map(|d| scaled(d, factor));
            let view = |i: usize| RectifiedView { image: &shots[i].0, map: &maps[i], camera: positions[i] };
            *Agreement::of(&[view(0), view(1)]).worst().unwrap()
        };
        let (right, swapped, wrong) =
            (share([0.0, 1.0], 1.0), share([1.0, 0.0], 1.0), share([0.0, 1.0], 4.0));
        assert!(right.share > 0.8 && !right.is_poor(), "{right:?}");
        assert!(swapped.is_poor() && wrong.is_poor(), "{swapped:?} {wrong:?}");
    }

    #[test]
    fn both_geometries_agree_alike() {
        let cameras = [0.0, 1.0].map(|p| Camera::metric(rig_camera(p, SIZE), false).unwrap());
        let shots = [0.0, 1.0].map(record);
        let disparities = shots.each_ref().map(|s| rig_disparity(&s.1, SIZE.0));
        let free = |i: usize| CalibratedView { image: &shots[i].0, map: &shots[i].1, camera: cameras[i] };
        let row = |i: usize| RectifiedView { image: &shots[i].0, map: &disparities[i], camera: i as f64 };
        let a = Agreement::of(&[free(0), free(1)]);
        let b = Agreement::of(&[row(0), row(1)]);
        assert!((a.pairs[0].share - b.pairs[0].share).abs() < 0.03, "{a:?} {b:?}");
    }

    #[test]
    fn exposures_are_measured_and_small_differences_left() {
        let shots = [0.0, 1.0].map(record);
        let disparities = shots.each_ref().map(|s| rig_disparity(&s.1, SIZE.0));
        let gains = |factor: f32| {
            let mut brighter = shots[1].0.clone();
            brighter.data_mut().iter_mut().for_each(|v| *v *= factor);
            let first = RectifiedView { image: &shots[0].0, map: &disparities[0], camera: 0.0 };
            let second = RectifiedView { image: &brighter, map: &disparities[1], camera: 1.0 };
            Agreement::of(&[first, second]).gains
        };
        let found = gains(0.8);
        assert!(found[0] == 1.0 && (found[1] - 1.25).abs() < 0.03, "{found:?}");
        assert_eq!(gains(1.01), [1.0, 1.0]);
    }

    #[test]
    fn one_view_and_views_apart_have_no_verdict() {
        let (image, depth) = record(0.0);
        let disparity = rig_disparity(&depth, SIZE.0);
        let view = |position| RectifiedView { image: &image, map: &disparity, camera: position };
        assert_eq!(Agreement::of(&[view(0.0)]).worst(), None);
        let apart = Agreement::of(&[view(0.0), view(100.0)]);
        assert!(apart.pairs.is_empty() && apart.gains == [1.0, 1.0]);
    }
}
