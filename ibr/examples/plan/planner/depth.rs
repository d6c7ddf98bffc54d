//! What errors of depth cost.

use hybank_ibr::analysis::{ViewError, depth_jitter};
use hybank_ibr::pipeline::{RenderError, RenderSettings};
use hybank_ibr::propagate::RectifiedView;

/// Mean absolute error of a view, in grey levels, when independent errors of the standard deviation
/// `deviation` pixels (for a baseline of one) are added to the disparities of its inputs.
///
/// `now` is the prediction for the inputs as they are. The view is rendered once more with such errors, and
/// at each pixel the change is added as the root of the sum of the squares: the two errors are independent.
///
/// # Errors
/// Those of [`hybank_ibr::pipeline::rectified::render`].
pub fn price_of_depth_errors(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
    now: &ViewError,
    deviation: f64,
) -> Result<f64, RenderError> {
    let jitter = depth_jitter(views, &position, settings, &now.rendering.image, deviation)?;
    let pixels = now.estimate.iter().zip(&jitter);
    Ok(pixels.map(|(e, j)| f64::from(e.hypot(*j))).sum::<f64>() / jitter.len() as f64)
}
