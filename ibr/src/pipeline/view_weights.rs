//! The share of each view in the virtual one, and its exposure.

use super::depth_errors::median;
use super::exposure::drifts;
use super::{Agreement, Exposure};
use crate::camera::Camera;
use crate::propagate::{CalibratedView, View, Viewpoint};
use crate::sample::Sample;

/// Keeps the weights finite at the place of a view, where that view then weighs this much more than its
/// counterpart at the other end: (1 + SOFTENING) / SOFTENING to its inverse.
const SOFTENING: f64 = 0.2;

/// The least variance of the differences between views: that of rounding to whole grey levels, with a
/// margin.
const LEAST_VARIANCE: f64 = 1.0;

/// Weights of the views: near ones count more.
///
/// With x_i the distance of view i from the virtual camera, in units of the sum of the two least distances,
///
/// ```text
/// w_i = (1 - x_i + s) / (x_i + s),   s = 0.2,   x_i cut off at 1
/// ```
///
/// Half-way between two views both weigh 1. The weights change continuously along any path of the virtual
/// camera, so a sequence of views does not pulse.
///
/// Of general cameras, the distance of a view is the sum of two, both in units of the distance to the scene:
/// that of the camera centres, and that of the directions from which they look at the middle of the scene.
/// If only the k nearest views are used, w_i is multiplied by (x_(k+1) - x_i) / (x_(k+1) - x_(1)), with the
/// distances of the first view that is left out and of the nearest, so that a view enters and leaves without
/// a jump (Buehler et al., Unstructured Lumigraph Rendering, SIGGRAPH 2001).
#[derive(Debug, Clone, PartialEq)]
pub struct ViewWeights {
    weights: Vec<f32>,
    distances: Vec<f64>,
    /// Factors that give the views one exposure; empty if they are not wanted.
    gains: Vec<[f32; 3]>,
}

impl ViewWeights {
    /// From the distances of the views.
    pub fn by_distance(distances: &[f64]) -> Self {
        let mut sorted = distances.to_vec();
        sorted.sort_by(f64::total_cmp);
        let scale = sorted.iter().take(2).sum::<f64>();
        let weight = |distance: &f64| {
            let x = (distance / scale).min(1.0);
            ((1.0 - x + SOFTENING) / (x + SOFTENING)) as f32
        };
        let weights = match sorted.len() > 1 && scale > 0.0 {
            true => distances.iter().map(weight).collect(),
            false => vec![1.0; distances.len()],
        };
        Self { weights, distances: distances.to_vec(), gains: Vec::new() }
    }

    /// The same for views whose surfaces are displaced: w_i is multiplied by (d_2 / d_i)^4 beyond the second
    /// least distance d_2.
    ///
    /// Surfaces from tracks alone err between the tracks, in all views alike and more with the distance, so
    /// of two views on both sides of the virtual one the displacements cancel, and those of others are left.
    /// Three and four views of Model House were up to 0.38 dB below the two without this factor.
    pub(super) fn faded(mut self) -> Self {
        let mut sorted = self.distances.clone();
        sorted.sort_by(f64::total_cmp);
        let second = sorted.get(1).copied().unwrap_or(f64::INFINITY);
        for (weight, distance) in self.weights.iter_mut().zip(&self.distances) {
            *weight *= if *distance > second { (second / distance).powi(4) as f32 } else { 1.0 };
        }
        self
    }

    /// The two views that weigh most, of at least two.
    pub(super) fn first_two(&self) -> [usize; 2] {
        let mut order: Vec<usize> = (0..self.weights.len()).collect();
        order.sort_by(|a, b| self.weights[*b].total_cmp(&self.weights[*a]));
        [order[0], order[1]]
    }

    /// The same with the `count` nearest views only; all if there is no number.
    pub fn nearest(mut self, count: Option<usize>) -> Self {
        let mut order: Vec<usize> = (0..self.distances.len()).collect();
        order.sort_by(|a, b| self.distances[*a].total_cmp(&self.distances[*b]));
        let Some((chosen, rest)) = count.and_then(|count| order.split_at_checked(count)) else { return self };
        let (Some(first), Some(out)) = (chosen.first(), rest.first()) else { return self };
        let (least, limit) = (self.distances[*first], self.distances[*out]);
        for view in chosen {
            let share = (limit - self.distances[*view]) / (limit - least);
            self.weights[*view] *= if share.is_nan() { 1.0 } else { share as f32 };
        }
        rest.iter().for_each(|view| self.weights[*view] = 0.0);
        self
    }

    /// Whether samples of a view count at all.
    pub fn uses(&self, view: usize) -> bool {
        self.weights.get(view).is_none_or(|weight| *weight > 0.0)
    }

    /// The views that count, by number.
    pub fn views(&self) -> Vec<usize> {
        (0..self.weights.len()).filter(|view| self.uses(*view)).collect()
    }

    /// For a virtual camera among the views.
    pub fn of<P: Viewpoint>(views: &[View<'_, P>], camera: &P) -> Self {
        let distances: Vec<f64> = views.iter().map(|v| v.camera.distance(camera)).collect();
        Self::by_distance(&distances)
    }

    /// As [`ViewWeights::of`], with the distances in position and direction.
    pub fn by_angle(views: &[CalibratedView<'_>], camera: &Camera) -> Self {
        let centre = camera.centre();
        let mut reaches: Vec<f64> = views.iter().filter_map(|v| v.map.middle()).map(f64::from).collect();
        let Some(reach) = median(&mut reaches) else {
            return Self::of(views, camera);
        };
        let pivot = centre + camera.axis() * reach;
        let distance = |view: &CalibratedView<'_>| {
            let from = view.camera.centre();
            let angle = (from - pivot).angle(&(centre - pivot));
            // The axis of a view that looks past the scene is far from the direction to its middle.
            let turn = view.camera.axis().angle(&(pivot - from));
            (from - centre).norm() / reach + angle + turn
        };
        Self::by_distance(&views.iter().map(distance).collect::<Vec<_>>())
    }

    /// The same for photographs of unequal noise.
    ///
    /// Weights of least variance are inverse variances: that of the difference between the view and the
    /// virtual one, v / w_i with v the variance of the differences between views. Noise of the photograph
    /// adds to it:
    ///
    /// ```text
    /// v / w_i + sigma_i^2 - sigma_min^2
    /// ```
    ///
    /// Noise that all views have is left out: it is also in the photographs that a view is compared with.
    pub fn with_noise(mut self, agreement: &Agreement) -> Self {
        let Some(variance) = agreement.variance() else { return self };
        let variance = variance.max(LEAST_VARIANCE);
        let noise = |view: usize| agreement.noise(view);
        let least = self.views().into_iter().map(noise).fold(f64::INFINITY, f64::min);
        for (view, weight) in self.weights.iter_mut().enumerate() {
            let excess = (noise(view) - least).max(0.0);
            *weight = (variance / (variance / f64::from(*weight) + excess)) as f32;
        }
        self
    }

    /// The same with factors for the colours of the views, with which all have those of the first. As far as
    /// the brightness or a colour beside it drifts from view to view, the virtual view has that of its
    /// place: the mean by weights.
    pub fn with_gains(self, gains: &[Exposure]) -> Self {
        let weight = |view: usize| f64::from(self.weight(view as u16));
        let total: f64 = (0..gains.len()).map(weight).sum();
        let drifts = drifts(gains);
        let mean =
            |c: usize| drifts.iter().enumerate().map(|(view, drift)| weight(view) * drift[c]).sum::<f64>();
        let own: Exposure = std::array::from_fn(|c| if total > 0.0 { (-mean(c) / total).exp() } else { 1.0 });
        let factors = |gain: &Exposure| std::array::from_fn(|c| (gain[c] * own[c]) as f32);
        Self { gains: gains.iter().map(factors).collect(), ..self }
    }

    pub(super) fn total(&self) -> f64 {
        self.weights.iter().copied().map(f64::from).sum()
    }

    /// The weight of a view.
    pub fn weight(&self, view: u16) -> f32 {
        self.weights.get(usize::from(view)).copied().unwrap_or(1.0)
    }

    /// The factors for the colours of a view.
    pub fn gain(&self, view: u16) -> [f32; 3] {
        self.gains.get(usize::from(view)).copied().unwrap_or([1.0; 3])
    }

    /// Multiplies the weight and the colours of every sample by those of its view.
    pub fn apply<const C: usize>(&self, samples: &mut [Sample<C>]) {
        for samples in samples.chunk_by_mut(|a, b| a.view == b.view) {
            let (weight, gain) = (self.weight(samples[0].view), self.gain(samples[0].view));
            for s in samples {
                s.weight *= weight;
                s.value.iter_mut().zip(gain).for_each(|(v, g)| *v *= g);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Texture;
    use crate::pipeline::PairAgreement;

    #[test]
    fn a_photograph_with_more_noise_counts_less() {
        let texture = |noise| Some(Texture { noise, slope: 10.0 });
        let pair =
            PairAgreement { views: [0, 1], points: 1000, share: 0.9, gain: [1.0; 3], difference: 10.0 };
        let weights = |noise: [f64; 2], pairs: Vec<PairAgreement>| {
            let textures = noise.map(texture).to_vec();
            let agreement = Agreement { pairs, gains: vec![[1.0; 3]; 2], textures, ..Agreement::default() };
            ViewWeights::by_distance(&[0.5, 0.5]).with_noise(&agreement).weights
        };
        assert_eq!(weights([5.0, 5.0], vec![pair]), [1.0, 1.0]);
        assert_eq!(weights([5.0, 9.0], Vec::new()), [1.0, 1.0]);
        // Of the differences' variance 100 the noise explains (3^2 + 9^2) / 3.
        let unequal = weights([3.0, 9.0], vec![pair]);
        assert_eq!(unequal[0], 1.0);
        assert!((f64::from(unequal[1]) - 1.0 / (1.0 + 72.0 / 70.0)).abs() < 1e-6, "{unequal:?}");
    }

    #[test]
    fn half_way_all_is_equal_and_at_a_view_that_view_decides() {
        assert_eq!(ViewWeights::by_distance(&[0.5, 0.5]).weights, [1.0, 1.0]);
        let at_first = ViewWeights::by_distance(&[0.0, 2.0]).weights;
        assert!(at_first[0] > 5.0 && at_first[1] < 0.2, "{at_first:?}");
        assert_eq!(ViewWeights::by_distance(&[3.0]).weights, [1.0]);
        assert_eq!(ViewWeights::by_distance(&[0.0, 0.0, 5.0]).weights, [1.0; 3]);
    }

    #[test]
    fn exposures_are_matched() {
        let mut samples = [Sample::<1> { value: [100.0], view: 1, ..Sample::BLANK }];
        ViewWeights::by_distance(&[1.0, 1.0]).with_gains(&[[1.0; 3]; 2]).apply(&mut samples);
        assert_eq!(samples[0].value, [100.0]);
        ViewWeights::by_distance(&[1.0, 1.0]).with_gains(&[[1.0; 3], [1.5; 3]]).apply(&mut samples);
        assert_eq!(samples[0].value, [150.0]);
        // The brightness drifts, or the colours beside a large difference of the brightness; the view is
        // three times as near to the second one.
        for (large, small) in [(1.0, [1.005; 3]), (1.2, [1.004, 1.0, 1.0 / 1.004])] {
            let weights = ViewWeights { weights: vec![1.0, 3.0], ..ViewWeights::by_distance(&[1.0, 1.0]) };
            let weights = weights.with_gains(&[[1.0; 3], small.map(|gain| large * gain)]);
            let is_near = |found: [f32; 3], common: f64, power: f64| {
                let want = small.map(|gain| common * gain.powf(power));
                found.into_iter().zip(want).all(|(found, want)| (f64::from(found) - want).abs() < 1e-5)
            };
            assert!(is_near(weights.gain(0), 1.0, -0.75), "{:?}", weights.gain(0));
            assert!(is_near(weights.gain(1), large, 0.25), "{:?}", weights.gain(1));
        }
    }

    #[test]
    fn the_nearest_views_are_used() {
        let two = ViewWeights::by_distance(&[3.0, 1.0, 2.0, 9.0]).nearest(Some(2));
        assert_eq!(two.views(), [1, 2]);
        assert!(two.weights[1] > two.weights[2] && !two.uses(0));
        let all = ViewWeights::by_distance(&[3.0, 1.0]);
        assert_eq!((all.clone().nearest(Some(2)), all.clone().nearest(None)), (all.clone(), all));
        assert_eq!(ViewWeights::by_distance(&[1.0, 1.0, 1.0]).nearest(Some(2)).views(), [0, 1]);
    }

    #[test]
    fn views_beyond_the_two_nearest_fade() {
        let plain = ViewWeights::by_distance(&[1.0, 2.0, 0.9, 1.1]);
        let faded = plain.clone().faded();
        let factors: Vec<f32> = faded.weights.iter().zip(&plain.weights).map(|(a, b)| a / b).collect();
        let want = [1.0, 0.0625, 1.0, 1.1_f32.powi(-4)];
        assert!(factors.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-6), "{factors:?}");
        let alone = ViewWeights::by_distance(&[3.0]);
        assert_eq!(alone.clone().faded(), alone);
        // Continuous where two views change places.
        let at = |d: f64| ViewWeights::by_distance(&[1.0, 2.0 - d, 2.0 + d]).faded().weights;
        let (a, b) = (at(-1e-4), at(1e-4));
        assert!(a.iter().zip(&b).all(|(a, b)| (a / b - 1.0).abs() < 2e-3), "{a:?} {b:?}");
    }

    /// Of two views at one distance, the one that looks at the scene from a similar direction is nearer, and
    /// one that looks away is the farthest.
    #[test]
    fn directions_count_too() {
        let image = crate::image::Image::filled(4, 3, 1, 0.0);
        let depth =
            crate::depth::DepthMap::new((4, 3), vec![5.0; 12], 1.0, crate::depth::Measure::Depth).unwrap();
        let view = |centre: [f64; 3], yaw: f64| {
            let r = nalgebra::Rotation3::from_euler_angles(0.0, yaw, 0.0);
            let mut matrix = nalgebra::Matrix3x4::zeros();
            matrix.fixed_columns_mut::<3>(0).copy_from(r.matrix());
            matrix.set_column(3, &-(r * nalgebra::Vector3::from(centre)));
            CalibratedView { image: &image, map: &depth, camera: Camera::metric(matrix, false).unwrap() }
        };
        let beside = view([1.0, 0.0, 0.0], 0.2);
        let before = view([0.0, 0.0, 1.0], 0.0);
        let away = view([0.1, 0.0, 0.0], 3.0);
        let target = view([0.0; 3], 0.0).camera;
        let found = ViewWeights::by_angle(&[beside, before, away], &target);
        assert!(found.distances[1] < found.distances[0], "{:?}", found.distances);
        assert!(found.distances[0] < found.distances[2], "{:?}", found.distances);
        assert_eq!(found.nearest(Some(1)).views(), [1]);
    }

    #[test]
    fn weights_change_continuously_along_a_path() {
        let cameras = [0.0, 1.0, 2.5];
        let at = |c: f64| ViewWeights::by_distance(&cameras.map(|p: f64| (p - c).abs())).weights;
        let two =
            |c: f64| ViewWeights::by_distance(&cameras.map(|p: f64| (p - c).abs())).nearest(Some(2)).weights;
        for k in 0..2500 {
            let (a, b) = (two(f64::from(k) * 1e-3), two(f64::from(k + 1) * 1e-3));
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.05), "{k}: {a:?} {b:?}");
        }
        let step = 1e-3;
        for k in -500..3000 {
            let (a, b) = (at(f64::from(k) * step), at(f64::from(k + 1) * step));
            assert!(a.iter().zip(&b).all(|(a, b)| (a / b).ln().abs() < 0.03), "{k}: {a:?} {b:?}");
        }
    }
}
