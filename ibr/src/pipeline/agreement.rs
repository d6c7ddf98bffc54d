//! Whether the inputs fit each other, from the inputs alone: points that one view gives by its depth must
//! lie at the same depth and have the same colour in another view.

use super::Exposure;
use super::depth_errors::{self, FEWEST_POINTS, Lookups};
use crate::depth::{FAR, Measure};
use crate::image::Texture;
use crate::propagate::{View, Viewpoint, nearest};
use crate::surfaces::DepthTest;
use rayon::prelude::*;
use std::fmt;

/// Pixels of each view that are compared, about.
const COMPARED_PIXELS: usize = 20_000;

/// Two views show one point if its colours differ by at most this many grey levels.
pub(crate) const GREY_LEVELS: f32 = 20.0;

/// Share of agreeing points below which the inputs are probably wrong.
const LEAST_SHARE: f64 = 0.5;

/// Bands of rows over which a ratio of colours is compared with itself.
const BANDS: usize = 16;

/// A ratio counts as far as it exceeds so many standard deviations of its error.
const GAIN_DEVIATIONS: f64 = 3.0;

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
    /// Red, green and blue of the second view divided by those of the first, at points of the same depth;
    /// the ratio of the brightness if one of the views is grey.
    pub gain: Exposure,
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

impl fmt::Display for PairAgreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([first, second], percent) = (self.views.map(|view| view + 1), 100.0 * self.share);
        let points = self.points;
        write!(
            f,
            "views {first} and {second} agree in depth and colour at only {percent:.0} % of {points} points"
        )
    }
}

/// The agreement of all views, each with the closest of those before it.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Agreement {
    /// The pairs that share enough points for a verdict.
    pub pairs: Vec<PairAgreement>,
    /// Factors for each view that give it the exposure and the white balance of the first one.
    pub gains: Vec<Exposure>,
    /// Noise and slopes of each photograph, where it shows them.
    pub textures: Vec<Option<Texture>>,
    /// Standard deviation of the independent errors of each map: pixels of disparity for a baseline of one,
    /// or shares of the depth. 0 where a view shares too few points with another.
    pub depth_errors: Vec<f64>,
}

impl Agreement {
    /// Of views of one kind.
    pub fn of<P: Viewpoint>(views: &[View<'_, P>]) -> Self {
        let textures = views.par_iter().map(|view| Texture::of(view.image)).collect();
        let mut agreement = Self { gains: vec![[1.0; 3]; views.len()], textures, ..Self::default() };
        let compared = |j: usize| {
            let i = nearest(views, j, 0..j)?;
            let pair = Comparison::new(&views[i], &views[j]).verdict([i, j])?;
            let look =
                |a: &View<'_, P>, b: &View<'_, P>| Lookups::of(a.map, b.map, a.camera.map_to(&b.camera));
            let lookups = [look(&views[i], &views[j]), look(&views[j], &views[i])];
            Some((pair, depth_errors::of_each(lookups)))
        };
        let compared: Vec<_> = (1..views.len()).into_par_iter().filter_map(compared).collect();
        // Of each view those of good pairs, and of poor ones.
        let mut errors = vec![[Vec::new(), Vec::new()]; views.len()];
        for (pair, variances) in compared {
            let [i, j] = pair.views;
            // Colours at points that do not correspond say nothing.
            let gain = if pair.is_poor() { [1.0; 3] } else { pair.gain };
            agreement.gains[j] = std::array::from_fn(|c| agreement.gains[i][c] / gain[c]);
            let is_poor = usize::from(pair.is_poor());
            for (view, variance) in pair.views.into_iter().zip(variances.into_iter().flatten()) {
                errors[view][is_poor].push(variance);
            }
            agreement.pairs.push(pair);
        }
        let deviation = |[good, poor]: &[Vec<f64>; 2]| {
            let found = if good.is_empty() { poor } else { good };
            (found.iter().sum::<f64>() / found.len().max(1) as f64).sqrt()
        };
        agreement.depth_errors = errors.iter().map(deviation).collect();
        agreement
    }

    /// Variance of the noise of a view, with its exposure; 0 if its photograph does not show it.
    pub(super) fn noise(&self, view: usize) -> f64 {
        let texture = self.textures.get(view).copied().flatten();
        // That of green, as the noise.
        let gain = self.gains.get(view).map_or(1.0, |gain| gain[1]);
        texture.map_or(0.0, |texture| (texture.noise * gain).powi(2))
    }

    /// Standard deviation of the errors of a map; 0 if it is not known.
    pub(crate) fn depth_error(&self, view: usize) -> f64 {
        self.depth_errors.get(view).copied().unwrap_or(0.0)
    }

    /// For each view the first of those with which it agrees, directly or by way of others; itself where it
    /// agrees with none before it.
    pub(crate) fn groups(&self) -> Vec<usize> {
        let mut groups: Vec<usize> = (0..self.gains.len()).collect();
        for [i, j] in self.pairs.iter().filter(|pair| !pair.is_poor()).map(|pair| pair.views) {
            groups[j] = groups[i];
        }
        groups
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

struct Comparison {
    points: usize,
    /// Colours in both views of the points at which the depths agree.
    matched: Vec<[[f32; 3]; 2]>,
    is_grey: bool,
}

impl Comparison {
    fn new<P: Viewpoint>(first: &View<'_, P>, second: &View<'_, P>) -> Self {
        let (image, other, other_map) = (first.image, second.image, second.map);
        let to_second = first.camera.map_to(&second.camera);
        let is_grey = image.channels() != 3 || other.channels() != 3;
        let (width, height) = image.size();
        let step = ((width * height / COMPARED_PIXELS) as f64).sqrt().ceil().max(1.0) as usize;
        let rows: Vec<usize> = (0..height).step_by(step).collect();
        let of_row = |y: &usize| {
            let mut all = Self { points: 0, matched: Vec::new(), is_grey };
            for x in (0..width).step_by(step) {
                let (u, v, d) = to_second(x as f64, *y as f64, f64::from(first.map.row(*y)[x]));
                // What is infinitely far away agrees whatever the depths are. None for NaN, hence for pixels
                // without depth.
                let Some(q) = other.pixel_at(u, v) else { continue };
                let there = other_map.data()[q];
                let is_far = other_map.measure() == Measure::Depth && there >= FAR && d >= f64::from(FAR);
                if there.is_nan() || is_far {
                    continue;
                }
                all.points += 1;
                if DepthTest::are_one_point(d as f32, there, other_map) {
                    all.matched.push([image.pixel(y * width + x), other.pixel(q)]);
                }
            }
            all
        };
        let parts: Vec<Self> = rows.par_iter().with_min_len(16).map(of_row).collect();
        let points = parts.iter().map(|part| part.points).sum();
        Self { points, matched: parts.into_iter().flat_map(|part| part.matched).collect(), is_grey }
    }

    fn verdict(&self, views: [usize; 2]) -> Option<PairAgreement> {
        if self.points < FEWEST_POINTS {
            return None;
        }
        let gain = self.gain();
        let alike =
            |[a, b]: &&[[f32; 3]; 2]| (brightness(b, [1.0; 3]) - brightness(a, gain)).abs() <= GREY_LEVELS;
        let share = self.matched.iter().filter(alike).count() as f64 / self.points as f64;
        Some(PairAgreement { views, points: self.points, share, gain, difference: self.difference(gain) })
    }

    fn difference(&self, gain: Exposure) -> f64 {
        let back = gain.map(|gain| 1.0 / gain);
        let square =
            |[a, b]: &[[f32; 3]; 2]| f64::from(brightness(b, back) - brightness(a, [1.0; 3])).powi(2);
        (self.matched.iter().map(square).sum::<f64>() / self.matched.len().max(1) as f64).sqrt()
    }

    fn gain(&self) -> Exposure {
        match self.is_grey {
            true => [self.ratio(|colour| brightness(colour, [1.0; 3])); 3],
            false => std::array::from_fn(|c| self.ratio(|colour| colour[c])),
        }
    }

    /// The median ratio of some value at points that are neither dark nor overexposed; 1 of too few, and
    /// nearer to 1 the less it exceeds its error.
    fn ratio(&self, value: impl Fn(&[f32; 3]) -> f32) -> f64 {
        let usable = |v: f32| (16.0..250.0).contains(&v);
        let values = self.matched.iter().map(|pair| [value(&pair[0]), value(&pair[1])]);
        let both = values.filter(|[a, b]| usable(*a) && usable(*b));
        let mut ratios: Vec<f64> = both.map(|[a, b]| f64::from(b / a).ln()).collect();
        if ratios.len() < FEWEST_POINTS {
            return 1.0;
        }
        let error = error_of_median(&ratios);
        depth_errors::median(&mut ratios).map_or(1.0, |ratio| shrunk(ratio, error).exp())
    }
}

/// Standard deviation of the median of some numbers, from the medians of bands of them: neighbours have
/// errors in common, so their count says little.
fn error_of_median(numbers: &[f64]) -> f64 {
    let bands = numbers.chunks(numbers.len().div_ceil(BANDS).max(1));
    let medians: Vec<f64> = bands.filter_map(|band| depth_errors::median(&mut band.to_vec())).collect();
    let count = medians.len() as f64;
    let mean = medians.iter().sum::<f64>() / count;
    let squares = medians.iter().map(|m| (m - mean).powi(2)).sum::<f64>();
    (squares / (count * (count - 1.0)).max(1.0)).sqrt()
}

/// A number that was found with an error, nearer to 0: the estimator of James and Stein.
fn shrunk(found: f64, error: f64) -> f64 {
    let part = GAIN_DEVIATIONS * error / found.abs().max(f64::MIN_POSITIVE);
    found * (1.0 - part * part).max(0.0)
}

fn brightness(colour: &[f32; 3], gain: Exposure) -> f32 {
    colour.iter().zip(gain).map(|(v, g)| v * g as f32).sum::<f32>() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::depth::DepthMap;
    use crate::image::Image;
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

    /// Two views agree, and a third one, whose map is that of the first, stands elsewhere.
    #[test]
    fn views_that_contradict_do_not_measure_depth() {
        let shots = [0.0, 1.0].map(record);
        let disparities = shots.each_ref().map(|s| rig_disparity(&s.1, SIZE.0));
        let view = |i: usize, camera: f64| RectifiedView { image: &shots[i].0, map: &disparities[i], camera };
        let alone = Agreement::of(&[view(0, 0.0), view(1, 1.0)]);
        let three = Agreement::of(&[view(0, 0.0), view(1, 1.0), view(0, 4.0)]);
        assert_eq!((three.groups(), alone.groups()), (vec![0, 0, 2], vec![0, 0]));
        assert_eq!(three.depth_errors[..2], alone.depth_errors[..]);
        assert!(three.depth_errors[2] > 10.0 * alone.depth_errors[1], "{:?}", three.depth_errors);
    }

    /// A view that shares nothing with the others leaves their errors as they are.
    #[test]
    fn a_view_apart_leaves_the_errors_of_the_others() {
        let shots = [0.0, 1.0].map(record);
        let disparities = shots.each_ref().map(|s| rig_disparity(&s.1, SIZE.0));
        let dice = &mut crate::uncalibrated::random::dice::Dice::new(4);
        let noisy = disparities.each_ref().map(|map| map.changed(|v| v + 0.5 * dice.normal() as f32));
        let view = |i: usize, camera: f64| RectifiedView { image: &shots[i].0, map: &noisy[i], camera };
        let alone = Agreement::of(&[view(0, 0.0), view(1, 1.0)]).depth_errors;
        let apart = Agreement::of(&[view(0, 0.0), view(1, 1.0), view(0, 500.0)]).depth_errors;
        assert_eq!((&apart[..2], apart[2]), (&alone[..], 0.0));
        assert!(alone.iter().all(|error| (0.3..0.7).contains(error)), "{alone:?}");
    }

    #[test]
    fn exposures_and_white_balances_are_measured() {
        let shots = [0.0, 1.0].map(record);
        let disparities = shots.each_ref().map(|s| rig_disparity(&s.1, SIZE.0));
        let gains = |factors: [f32; 3]| {
            let mut brighter = shots[1].0.clone();
            brighter.data_mut().iter_mut().enumerate().for_each(|(i, v)| *v *= factors[i % 3]);
            let first = RectifiedView { image: &shots[0].0, map: &disparities[0], camera: 0.0 };
            let second = RectifiedView { image: &brighter, map: &disparities[1], camera: 1.0 };
            Agreement::of(&[first, second]).gains
        };
        for factors in [[0.8; 3], [0.965; 3], [0.9, 1.0, 1.1]] {
            let found = gains(factors);
            assert_eq!(found[0], [1.0; 3]);
            let is_right = |(gain, factor): (f64, f32)| (gain * f64::from(factor) - 1.0).abs() < 0.02;
            assert!(found[1].into_iter().zip(factors).all(is_right), "{factors:?}: {found:?}");
        }
    }

    /// Sixteen bands whose medians are 1 and -1 in turn.
    #[test]
    fn ratios_within_their_error_are_one() {
        let numbers: Vec<f64> = (0..16 * 9).map(|i| if i / 9 % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert!((error_of_median(&numbers) - (16.0_f64 / 15.0).sqrt() / 4.0).abs() < 1e-12);
        assert_eq!((shrunk(0.0, 0.0), shrunk(0.3, 0.1), shrunk(-0.3, 0.0)), (0.0, 0.0, -0.3));
        assert!((shrunk(-0.6, 0.1) + 0.45).abs() < 1e-12);
        // Noise of 10 grey levels in photographs of one exposure.
        let shots = [0.0, 1.0].map(record);
        let disparities = shots.each_ref().map(|s| rig_disparity(&s.1, SIZE.0));
        let dice = &mut crate::uncalibrated::random::dice::Dice::new(3);
        let noisy = shots.each_ref().map(|shot| {
            let mut image = shot.0.clone();
            image.data_mut().iter_mut().for_each(|v| *v += 10.0 * dice.normal() as f32);
            image
        });
        let view = |i: usize| RectifiedView { image: &noisy[i], map: &disparities[i], camera: i as f64 };
        assert_eq!(Agreement::of(&[view(0), view(1)]).gains, [[1.0; 3]; 2]);
    }

    #[test]
    fn one_view_and_views_apart_have_no_verdict() {
        let (image, depth) = record(0.0);
        let disparity = rig_disparity(&depth, SIZE.0);
        let view = |position| RectifiedView { image: &image, map: &disparity, camera: position };
        assert_eq!(Agreement::of(&[view(0.0)]).worst(), None);
        let apart = Agreement::of(&[view(0.0), view(100.0)]);
        assert!(apart.pairs.is_empty() && apart.gains == [[1.0; 3]; 2]);
    }
}
