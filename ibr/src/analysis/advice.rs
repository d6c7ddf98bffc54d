//! What to spend on next: by how much the estimate of a view falls if one thing gets better.

use super::estimate::Predicted;
use super::predictor::Predictor;
use super::random::{bounded_normal, seeded};
use crate::analysis::{Cause, ViewError};
use crate::depth::{DepthMap, fill_unknown};
use crate::image::Image;
use crate::pipeline::{RenderError, Rendering};
use crate::propagate::View;

/// Values beyond this number are not taken for rounded ones.
const MOST_LEVELS: usize = 4096;

/// What three improvements would gain, in grey levels of the mean absolute error.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Advice {
    /// The largest cause.
    pub cause: Cause,
    /// Fall of the estimate if that cause were halved.
    pub halved: f64,
    /// Fall if the depth maps had one more bit; none if their values are not rounded.
    pub depth_bit: Option<f64>,
    /// One more view; none if it would not help.
    pub view: Option<AnotherView>,
}

/// One more view, at the best of the places that were tried.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct AnotherView {
    /// Position on the line of the cameras, or the three coordinates of a camera centre.
    pub place: Vec<f64>,
    /// Fall of the estimate.
    pub falls: f64,
}

impl Advice {
    fn new(now: &ViewError) -> Self {
        let cause = now.dominant();
        Self { cause, halved: now.causes[cause as usize] / 2.0, depth_bit: None, view: None }
    }

    /// For the view of `camera`, whose prediction is `now`.
    ///
    /// The further view stands half-way between the virtual camera and its neighbour, or on the side without
    /// one as far away as the nearest view, and looks like the virtual camera. Its photograph and depth are
    /// rendered from the others, with the noise of the photographs. Where no view sees, its depth is that of
    /// the background. The weights of the causes stay as they are.
    ///
    /// # Errors
    /// Those of [`crate::pipeline`].
    pub fn on<P: Predicted>(
        predictor: &Predictor<'_, P>,
        camera: &P,
        size: (usize, usize),
        now: &ViewError,
    ) -> Result<Self, RenderError> {
        let (views, before) = (predictor.views(), now.totals().estimate);
        let mut advice = Self::new(now);
        let step = views.iter().map(|v| rounding_step(v.map)).fold(0.0, f64::max);
        if step > 0.0 {
            let change = predictor.change(camera, &now.rendering.image, with_a_bit_less)?;
            advice.depth_bit = Some(gain_of_a_bit(&now.estimate, &change));
        }
        for (coordinates, further) in camera.further(&views) {
            let (image, map) = imagined(predictor.render(&further, size)?);
            let another = View { image: &image, map: &map, camera: further };
            let all = [&views[..], &[another]].concat();
            advice.consider(coordinates, before - predictor.estimate_from(&all, camera, size)?);
        }
        Ok(advice)
    }

    fn consider(&mut self, place: Vec<f64>, falls: f64) {
        if falls > self.view.as_ref().map_or(0.0, |best| best.falls) {
            self.view = Some(AnotherView { place, falls });
        }
    }
}

/// Photograph and depth of a place where no camera stands, from a rendering.
fn imagined(rendering: Rendering) -> (Image, DepthMap) {
    let noises = rendering.agreement.textures.iter().flatten().map(|texture| texture.noise);
    let (sum, count) = noises.fold((0.0, 0.0), |(sum, count), noise| (sum + noise, count + 1.0));
    let deviation = if count > 0.0 { sum / count } else { 0.0 };
    let random = &mut seeded(2);
    let mut noise = || deviation * bounded_normal(random);
    let (mut image, mut depth) = (rendering.image, rendering.depth);
    image.data_mut().iter_mut().for_each(|v| *v = (f64::from(*v) + noise()).clamp(0.0, 255.0) as f32);
    fill_unknown(&mut depth);
    (image, depth)
}

/// The step to which the values of a map are rounded: the least difference of two of them. Maps of more than
/// 4096 different values are not taken for rounded; their step is 0.
fn rounding_step(map: &DepthMap) -> f64 {
    let measured = map.data().iter().enumerate().filter(|(p, v)| !v.is_nan() && !map.is_guessed(*p));
    let mut levels = std::collections::BTreeSet::new();
    for (_, value) in measured {
        // Values are not negative zero; their bits are in their order for values of one sign.
        levels.insert(value.to_bits());
        if levels.len() > MOST_LEVELS {
            return 0.0;
        }
    }
    let mut values: Vec<f64> = levels.into_iter().map(|bits| f64::from(f32::from_bits(bits))).collect();
    values.sort_by(f64::total_cmp);
    values.windows(2).map(|pair| pair[1] - pair[0]).min_by(f64::total_cmp).unwrap_or(0.0)
}

/// A rounded map with one bit less.
fn with_a_bit_less(map: &DepthMap) -> DepthMap {
    let step = rounding_step(map);
    map.changed(|v| paired(v, step))
}

/// The middle of a multiple of `step` and its partner: values as they were with one bit less. 0 leaves them.
fn paired(value: f32, step: f64) -> f32 {
    if step == 0.0 {
        return value;
    }
    let pair = ((f64::from(value) / step).round() / 2.0).floor();
    ((2.0 * pair + 0.5) * step) as f32
}

/// Fall of the mean estimate if rounded maps had one more bit, from the change c of each pixel if they had
/// one less.
///
/// With the step s their errors have the variance s^2 / 12, those of a bit more s^2 / 48, and a bit less
/// adds s^2 / 4. So s^2 / 12 - s^2 / 48 costs c^2 / 4 of the square of each pixel.
fn gain_of_a_bit(estimate: &[f32], change: &[f32]) -> f64 {
    let of_pixel = |(e, c): (&f32, &f32)| {
        let (e, c) = (f64::from(*e), f64::from(*c));
        e - (e * e - c * c / 4.0).max(e * e / 4.0).sqrt()
    };
    estimate.iter().zip(change).map(of_pixel).sum::<f64>() / estimate.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::Measure;

    #[test]
    fn steps_of_rounded_maps_are_found() {
        let map =
            |values: Vec<f32>| DepthMap::new((values.len(), 1), values, 1.0, Measure::Disparity).unwrap();
        let rounded = (0..500).map(|k| 3.0 + 0.25 * (k % 40) as f32).collect();
        assert_eq!(rounding_step(&map(rounded)), 0.25);
        let fine = (0..9000).map(|k| 3.0 + 1e-3 * k as f32).collect();
        assert_eq!(rounding_step(&map(fine)), 0.0);
    }

    /// A bit less adds three times the variance of the rounding, without a shift; what it costs says what a
    /// bit more gains.
    #[test]
    fn a_bit_less_tells_of_a_bit_more() {
        let (step, count) = (0.5, 1000);
        let errors: Vec<f64> =
            (0..count).map(|k| f64::from(paired(k as f32 * 0.5, step)) - 0.5 * k as f64).collect();
        let mean = errors.iter().sum::<f64>() / count as f64;
        let square = errors.iter().map(|e| e * e).sum::<f64>() / count as f64;
        assert!(mean.abs() < 1e-6 && (square - step * step / 4.0).abs() < 1e-6, "{mean} {square}");
        assert_eq!(paired(3.7, 0.0), 3.7);
        // Rounding alone, e^2 = c^2 / 3: half of it goes.
        let c = 3.0_f32.sqrt();
        assert!((gain_of_a_bit(&[1.0, 1.0], &[c, c]) - 0.5).abs() < 1e-6);
        assert_eq!(gain_of_a_bit(&[1.0], &[0.0]), 0.0);
    }
}
