//! The share of each view in the virtual one, and its exposure.

use crate::camera::Camera;
use crate::propagate::{CalibratedView, RectifiedView};
use crate::sample::Sample;

/// Keeps the weights finite at the place of a view, where that view then weighs this much more than its
/// counterpart at the other end: (1 + SOFTENING) / SOFTENING to its inverse.
const SOFTENING: f64 = 0.2;

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
#[derive(Debug, Clone, PartialEq)]
pub struct Balance {
    weights: Vec<f32>,
    /// Factors that give the views one exposure; empty if they have it.
    gains: Vec<f32>,
}

impl Balance {
    /// From the distances of the views.
    pub fn by_distance(distances: &[f64]) -> Self {
        let mut sorted = distances.to_vec();
        sorted.sort_by(f64::total_cmp);
        let scale = match sorted[..] {
            [first, second, ..] if first + second > 0.0 => first + second,
            _ => return Self { weights: vec![1.0; distances.len()], gains: Vec::new() },
        };
        let weight = |distance: &f64| {
            let x = (distance / scale).min(1.0);
            ((1.0 - x + SOFTENING) / (x + SOFTENING)) as f32
        };
        Self { weights: distances.iter().map(weight).collect(), gains: Vec::new() }
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

    /// The same with factors for the brightness of the views.
    pub fn with_gains(self, gains: &[f64]) -> Self {
        let needed = gains.iter().any(|g| *g != 1.0);
        Self { gains: if needed { gains.iter().map(|g| *g as f32).collect() } else { Vec::new() }, ..self }
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

#[cfg(test)]
mod tests {
    use super::*;

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
    fn weights_change_continuously_along_a_path() {
        let cameras = [0.0, 1.0, 2.5];
        let at = |c: f64| Balance::by_distance(&cameras.map(|p: f64| (p - c).abs())).weights;
        let step = 1e-3;
        for k in -500..3000 {
            let (a, b) = (at(f64::from(k) * step), at(f64::from(k + 1) * step));
            assert!(a.iter().zip(&b).all(|(a, b)| (a / b).ln().abs() < 0.03), "{k}: {a:?} {b:?}");
        }
    }
}
