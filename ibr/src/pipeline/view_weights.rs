//! The share of each view in the virtual one, and its exposure.

use super::exposure::drifts;
use super::{Agreement, Exposure};
use crate::propagate::{View, Viewpoint};
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
/// Only the k nearest views are used: w_i is multiplied by (x_(k+1) - x_i) / (x_(k+1) - x_(1)), with the
/// distances of the first view that is left out and of the nearest, so that a view enters and leaves without
/// a jump (Buehler et al., Unstructured Lumigraph Rendering, SIGGRAPH 2001).
#[derive(Debug, Clone, PartialEq)]
pub struct ViewWeights {
    weights: Vec<f32>,
    distances: Vec<f64>,
    /// What the noise of each view adds to the inverse of its weight; empty if it is not known.
    excess: Vec<f64>,
    /// Factors that give the views one exposure; empty if they are not wanted.
    gains: Vec<[f32; 3]>,
}

/// The weight at one of some distances, which are sorted.
pub(super) fn weight_of(distance: f64, sorted: &[f64]) -> f64 {
    let scale = sorted.iter().take(2).sum::<f64>();
    if sorted.len() < 2 || scale <= 0.0 {
        return 1.0;
    }
    let x = (distance / scale).min(1.0);
    (1.0 - x + SOFTENING) / (x + SOFTENING)
}

impl ViewWeights {
    /// From the distances of the views.
    pub fn by_distance(distances: &[f64]) -> Self {
        let mut sorted = distances.to_vec();
        sorted.sort_by(f64::total_cmp);
        let weights = distances.iter().map(|distance| weight_of(*distance, &sorted) as f32).collect();
        Self { weights, distances: distances.to_vec(), excess: Vec::new(), gains: Vec::new() }
    }

    /// The same with the `count` nearest views only.
    pub fn nearest(mut self, count: usize) -> Self {
        let mut order: Vec<usize> = (0..self.distances.len()).collect();
        order.sort_by(|a, b| self.distances[*a].total_cmp(&self.distances[*b]));
        let Some((chosen, rest)) = order.split_at_checked(count) else { return self };
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

    /// The same with some views only.
    pub(super) fn only(mut self, chosen: &[usize]) -> Self {
        let left_out = self.weights.iter_mut().enumerate().filter(|(view, _)| !chosen.contains(view));
        left_out.for_each(|(_, weight)| *weight = 0.0);
        self
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
        self.excess = (0..self.weights.len()).map(|view| (noise(view) - least).max(0.0) / variance).collect();
        self.weights = (0..).zip(&self.weights).map(|(view, w)| self.noisy(view, f64::from(*w))).collect();
        self
    }

    /// The weight of a view where it would have this one without noise.
    pub(super) fn noisy(&self, view: u16, weight: f64) -> f32 {
        let excess = self.excess.get(usize::from(view)).copied().unwrap_or(0.0);
        (if excess > 0.0 { 1.0 / (1.0 / weight + excess) } else { weight }) as f32
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
        let two = ViewWeights::by_distance(&[3.0, 1.0, 2.0, 9.0]).nearest(2);
        assert_eq!(two.views(), [1, 2]);
        assert!(two.weights[1] > two.weights[2] && !two.uses(0));
        let all = ViewWeights::by_distance(&[3.0, 1.0]);
        assert_eq!(all.clone().nearest(2), all);
        assert_eq!(ViewWeights::by_distance(&[1.0, 1.0, 1.0]).nearest(2).views(), [0, 1]);
    }

    #[test]
    fn weights_change_continuously_along_a_path() {
        let cameras = [0.0, 1.0, 2.5];
        let at = |c: f64| ViewWeights::by_distance(&cameras.map(|p: f64| (p - c).abs())).weights;
        let two = |c: f64| ViewWeights::by_distance(&cameras.map(|p: f64| (p - c).abs())).nearest(2).weights;
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
