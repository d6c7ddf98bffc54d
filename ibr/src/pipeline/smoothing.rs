//! Smoothing that suits the noise of the photographs.

use super::{Agreement, RenderSettings, ViewWeights};
use crate::depth::Measure;

/// Range of the smoothing: with less the fit is undetermined between samples, and with more the noise is
/// not that of a photograph.
const LEAST_SMOOTHING: f64 = 0.01;
const MOST_SMOOTHING: f64 = 4.0;

impl RenderSettings {
    /// The settings with the depth test that suits the maps, and with the lambda and the stiffness that suit
    /// the photographs; the smoothing is as it was with `keep_smoothing` or if no photograph shows its
    /// noise. The result keeps its smoothing.
    ///
    /// Depths of one point in two maps with independent errors of the deviation delta differ by sqrt(2)
    /// delta. So one sample hides another if they differ by three times that, disparities in pixels and
    /// depths as shares: of the samples of one surface one in 700 is then removed.
    ///
    /// Take the noise of the samples as white with the variance sigma^2 and the texture along a row as a
    /// random walk with the mean square slope s^2. The most probable row minimises
    ///
    /// ```text
    /// sum_k w_k (I_k - J(x_k))^2 / sigma^2  +  integral J'(x)^2 dx / s^2
    /// ```
    ///
    /// With W = sum of the weights of the samples per pixel, about that of the views, the second term is
    /// sum_k w_k J'(x_k)^2 / (W s^2). So lambda = sigma^2 / (W s^2) in the row fit. The plane fit counts
    /// edges of pixels instead of samples, so its stiffness is sigma^2 / s^2. Samples of general cameras are
    /// also displaced, which adds to them a variance v in proportion to s^2, so there it is never less than
    /// the stiffness of the settings times the mean area a of the samples: a sample that stands for a pixels
    /// has the weight a in the fit, the integral of |grad J|^2 over the image is the same for any
    /// magnification, and the two terms keep their ratio if the stiffness is a v / s^2.
    pub fn suited_to(&self, agreement: &Agreement, view_weights: &ViewWeights, measure: Measure) -> Self {
        let mut settings = Self { keep_smoothing: true, ..*self };
        let test = &mut settings.interpolation.depth_test;
        let differs = 3.0 * (2.0 * mean_square_error(agreement, view_weights)).sqrt();
        match measure {
            Measure::Disparity => test.parallax = test.parallax.max(differs),
            Measure::Depth => test.noise = test.noise.max(differs),
        }
        if self.keep_smoothing {
            return settings;
        }
        let (mut noise, mut slope) = (0.0, 0.0);
        for (view, texture) in agreement.textures.iter().enumerate() {
            let Some(texture) = texture else { continue };
            let weight = f64::from(view_weights.weight(view as u16));
            noise += weight * texture.noise * texture.noise;
            slope += weight * texture.slope * texture.slope;
        }
        if slope > 0.0 {
            let (fit, plane) = (&mut settings.interpolation.fit, &mut settings.interpolation.plane);
            fit.lambda = (noise / slope / view_weights.total()).clamp(LEAST_SMOOTHING, MOST_SMOOTHING);
            plane.noise_stiffness = (noise / slope).min(MOST_SMOOTHING);
        }
        settings
    }
}

/// Of the depths of the views that count, by their weights.
fn mean_square_error(agreement: &Agreement, view_weights: &ViewWeights) -> f64 {
    let weight = |view: usize| f64::from(view_weights.weight(view as u16));
    let (sum, total) = view_weights.views().into_iter().fold((0.0, 0.0), |(sum, total), view| {
        (sum + weight(view) * agreement.depth_error(view).powi(2), total + weight(view))
    });
    if total > 0.0 { sum / total } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Texture;

    fn suited(textures: &[Option<Texture>], settings: &RenderSettings) -> RenderSettings {
        let agreement = Agreement { textures: textures.to_vec(), ..Agreement::default() };
        settings.suited_to(&agreement, &ViewWeights::by_distance(&vec![1.0; textures.len()]), Measure::Depth)
    }

    #[test]
    fn more_noise_is_smoothed_more_and_more_samples_less() {
        let of = |noise| Some(Texture { noise, slope: 10.0 });
        let lambda = |textures: &[Option<Texture>]| {
            suited(textures, &RenderSettings::default()).interpolation.fit.lambda
        };
        assert!((lambda(&[of(5.0)]) - 0.25).abs() < 1e-12);
        assert!((lambda(&[of(5.0), of(5.0)]) - 0.125).abs() < 1e-7);
        assert_eq!(lambda(&[of(0.1)]), LEAST_SMOOTHING);
        assert_eq!(lambda(&[of(100.0)]), MOST_SMOOTHING);
    }

    /// Disparities of a deviation of 0.1 and 0.3 px; a third view does not count.
    #[test]
    fn the_depth_test_allows_for_errors_of_the_views_that_count() {
        let agreement = Agreement { depth_errors: vec![0.1, 0.3, 9.0], ..Agreement::default() };
        let weights = ViewWeights::by_distance(&[1.0, 1.0, 5.0]).nearest(2);
        let suited = RenderSettings::default().suited_to(&agreement, &weights, Measure::Disparity);
        let found = suited.interpolation.depth_test.parallax;
        assert!((found - 3.0 * 0.1_f64.sqrt()).abs() < 1e-6, "{found}");
    }

    #[test]
    fn photographs_without_texture_and_settings_that_are_kept_change_nothing() {
        let default = RenderSettings::default();
        assert_eq!(suited(&[None, None], &default).interpolation, default.interpolation);
        let noisy = Some(Texture { noise: 9.0, slope: 10.0 });
        let kept = RenderSettings { keep_smoothing: true, ..default };
        assert_eq!(suited(&[noisy], &kept).interpolation, default.interpolation);
        let suited = suited(&[noisy], &default);
        let (suited, default) = (suited.interpolation.plane, default.interpolation.plane);
        assert!(suited.noise_stiffness > default.stiffness && suited.stiffness == default.stiffness);
    }
}
