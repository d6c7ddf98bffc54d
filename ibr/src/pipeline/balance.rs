//! The share of each view in the virtual one, and its exposure.

use super::Agreement;
use crate::camera::Camera;
use crate::propagate::{CalibratedView, RectifiedView};
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
pub struct Balance {
    weights: Vec<f32>,
    distances: Vec<f64>,
    /// Factors that give the views one exposure; empty if they have it.
    gains: Vec<f32>,
}

impl Balance {
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

    /// For a virtual camera on the line of a rectified rig.
    pub fn rectified(views: &[RectifiedView<'_>], position: f64) -> Self {
        Self::by_distance(&views.iter().map(|v| (v.position - position).abs()).collect::<Vec<_>>())
    }

    /// For a virtual camera among general ones.
    pub fn calibrated(views: &[CalibratedView<'_>], camera: &Camera) -> Self {
        let centre = camera.centre();
        Self::by_distance(&views.iter().map(|v| (v.camera.centre() - centre).norm()).collect::<Vec<_>>())
    }

    /// As [`Balance::calibrated`], with the distances in position and direction.
    pub fn by_angle(views: &[CalibratedView<'_>], camera: &Camera) -> Self {
        let centre = camera.centre();
        let Some(reach) = median(views.iter().filter_map(|v| v.depth.middle()).map(f64::from)) else {
            return Self::calibrated(views, camera);
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
    /// The inverse of a weight is a variance: that of the difference between the view and the virtual one,
    /// in units of v, the variance of the differences between views. Noise adds to it,
    ///
    /// ```text
    /// 1 / w_i + (sigma_i^2 - sigma_min^2) / v
    /// ```
    ///
    /// Noise that all views have is left out: it is also in the photographs that a view is compared with.
    pub fn with_noise(mut self, agreement: &Agreement) -> Self {
        let Some(variance) = agreement.variance() else { return self };
        let noise = |view: usize| agreement.noise(view);
        let least = self.views().into_iter().map(noise).fold(f64::INFINITY, f64::min);
        for (view, weight) in self.weights.iter_mut().enumerate() {
            let excess = (noise(view) - least) / variance.max(LEAST_VARIANCE);
            *weight = (1.0 / (1.0 / f64::from(*weight) + excess.max(0.0))) as f32;
        }
        self
    }

    /// The same with factors for the brightness of the views.
    pub fn with_gains(self, gains: &[f64]) -> Self {
        let needed = gains.iter().any(|g| *g != 1.0);
        Self { gains: if needed { gains.iter().map(|g| *g as f32).collect() } else { Vec::new() }, ..self }
    }

    /// The sum of the weights.
    pub(super) fn total(&self) -> f64 {
        self.weights.iter().copied().map(f64::from).sum()
    }

    /// The weight of a view.
    pub fn weight(&self, view: u16) -> f32 {
        self.weights.get(usize::from(view)).copied().unwrap_or(1.0)
    }

    /// The factor for the brightness of a view.
    pub fn gain(&self, view: u16) -> f32 {
        self.gains.get(usize::from(view)).copied().unwrap_or(1.0)
    }

    /// Multiplies the weight and the brightness of every sample by those of its view.
    pub fn apply<const C: usize>(&self, samples: &mut [Sample<C>]) {
        for s in samples {
            let view = usize::from(s.view);
            s.weight *= self.weight(s.view);
            if let Some(gain) = self.gains.get(view) {
                s.value.iter_mut().for_each(|v| *v *= gain);
            }
        }
    }
}

/// The middle one of some numbers.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Texture;
    use crate::pipeline::PairAgreement;

    #[test]
    fn a_photograph_with_more_noise_counts_less() {
        let texture = |noise| Some(Texture { noise, slope: 10.0 });
        let pair = PairAgreement { views: [0, 1], points: 1000, share: 0.9, gain: 1.0, difference: 10.0 };
        let weights = |noise: [f64; 2], pairs: Vec<PairAgreement>| {
            let agreement = Agreement { pairs, gains: vec![1.0, 1.0], textures: noise.map(texture).to_vec() };
            Balance::by_distance(&[0.5, 0.5]).with_noise(&agreement).weights
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
        assert_eq!(Balance::by_distance(&[0.5, 0.5]).weights, [1.0, 1.0]);
        let at_first = Balance::by_distance(&[0.0, 2.0]).weights;
        assert!(at_first[0] > 5.0 && at_first[1] < 0.2, "{at_first:?}");
        assert_eq!(Balance::by_distance(&[3.0]).weights, [1.0]);
        assert_eq!(Balance::by_distance(&[0.0, 0.0, 5.0]).weights, [1.0; 3]);
    }

    #[test]
    fn exposures_are_matched() {
        let mut samples = [Sample::<1> { value: [100.0], view: 1, ..Sample::BLANK }];
        Balance::by_distance(&[1.0, 1.0]).with_gains(&[1.0, 1.0]).apply(&mut samples);
        assert_eq!(samples[0].value, [100.0]);
        Balance::by_distance(&[1.0, 1.0]).with_gains(&[1.0, 1.5]).apply(&mut samples);
        assert_eq!(samples[0].value, [150.0]);
    }

    #[test]
    fn the_nearest_views_are_used() {
        let two = Balance::by_distance(&[3.0, 1.0, 2.0, 9.0]).nearest(Some(2));
        assert_eq!(two.views(), [1, 2]);
        assert!(two.weights[1] > two.weights[2] && !two.uses(0));
        let all = Balance::by_distance(&[3.0, 1.0]);
        assert_eq!((all.clone().nearest(Some(2)), all.clone().nearest(None)), (all.clone(), all));
        assert_eq!(Balance::by_distance(&[1.0, 1.0, 1.0]).nearest(Some(2)).views(), [0, 1]);
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
            CalibratedView { image: &image, depth: &depth, camera: Camera::metric(matrix, false).unwrap() }
        };
        let beside = view([1.0, 0.0, 0.0], 0.2);
        let before = view([0.0, 0.0, 1.0], 0.0);
        let away = view([0.1, 0.0, 0.0], 3.0);
        let target = view([0.0; 3], 0.0).camera;
        let found = Balance::by_angle(&[beside, before, away], &target);
        assert!(found.distances[1] < found.distances[0], "{:?}", found.distances);
        assert!(found.distances[0] < found.distances[2], "{:?}", found.distances);
        assert_eq!(found.nearest(Some(1)).views(), [1]);
    }

    #[test]
    fn weights_change_continuously_along_a_path() {
        let cameras = [0.0, 1.0, 2.5];
        let at = |c: f64| Balance::by_distance(&cameras.map(|p: f64| (p - c).abs())).weights;
        let two =
            |c: f64| Balance::by_distance(&cameras.map(|p: f64| (p - c).abs())).nearest(Some(2)).weights;
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
