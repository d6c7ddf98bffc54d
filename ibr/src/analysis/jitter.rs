//! What errors of depth change in a view: it is rendered once more from depths with such errors.

use super::random::{bounded_normal, seeded};
use crate::depth::DepthMap;
use crate::image::Image;
use crate::pipeline::depth_errors::Lookups;
use crate::pipeline::{RenderError, RenderSettings, rectified};
use crate::propagate::RectifiedView;

/// Errors of disparity below this many pixels change nothing that can be seen.
const LEAST: f64 = 0.02;

/// Half the side of the window over which the change is averaged, in pixels.
const WINDOW: usize = 2;

/// Standard deviation of independent errors of the disparities, in pixels for a baseline of one, from the
/// maps alone: points that one map gives are looked up in the other. 0 for a single view.
///
/// With two maps of the standard deviation s the difference has s^2 (1 + 2/3): the second value is
/// interpolated between two neighbours. The median makes hidden points harmless. Errors that both maps
/// share, and offsets between the cameras, do not show.
pub fn disparity_noise(views: &[RectifiedView<'_>]) -> f64 {
    let lookups = |pair: &[RectifiedView<'_>]| {
        let shift = pair[0].position - pair[1].position;
        Lookups::of(pair[0].disparity, pair[1].disparity, |x, y, d| (x + shift * d, y, d))
    };
    views.windows(2).map(lookups).fold(Lookups::default(), Lookups::and).common()
}

/// The views' disparity maps with independent errors of this standard deviation, from a fixed seed.
pub fn with_noise(views: &[RectifiedView<'_>], deviation: f64, seed: u64) -> Vec<DepthMap> {
    let random = &mut seeded(seed);
    let mut error = || (deviation * bounded_normal(random)) as f32;
    views.iter().map(|v| v.disparity.changed(|d| d + error())).collect()
}

/// Local mean of the change of a view under errors of the disparities with a standard deviation of
/// `deviation` pixels for a baseline of one, in grey levels; 0 for deviations below 0.02.
///
/// # Errors
/// Those of [`rectified::render`].
pub fn depth_jitter(
    views: &[RectifiedView<'_>],
    position: f64,
    settings: &RenderSettings,
    view: &Image,
    deviation: f64,
) -> Result<Vec<f32>, RenderError> {
    let (width, height) = view.size();
    if deviation < LEAST {
        return Ok(vec![0.0; width * height]);
    }
    let maps = with_noise(views, deviation, 1);
    let noisy: Vec<RectifiedView<'_>> =
        views.iter().zip(&maps).map(|(v, disparity)| RectifiedView { disparity, ..*v }).collect();
    let changed = rectified::render(&noisy, position, settings)?.image;
    Ok(local_mean(&difference(&changed, view), (width, height)))
}

/// |a - b| of each pixel, mean over the channels; of the brightness, if only one image has colours.
pub(super) fn difference(a: &Image, b: &Image) -> Vec<f32> {
    if a.channels() != b.channels() {
        return difference(&a.to_grey(), &b.to_grey());
    }
    let channels = a.channels();
    let pairs = a.data().chunks_exact(channels).zip(b.data().chunks_exact(channels));
    pairs.map(|(p, q)| p.iter().zip(q).map(|(p, q)| (p - q).abs()).sum::<f32>() / channels as f32).collect()
}

/// Means over windows of 5 x 5 pixels, smaller at the border.
pub(super) fn local_mean(values: &[f32], (width, height): (usize, usize)) -> Vec<f32> {
    let range = |at: usize, side: usize| at.saturating_sub(WINDOW)..(at + WINDOW + 1).min(side);
    let mean = |p: usize| {
        let (columns, rows) = (range(p % width, width), range(p / width, height));
        let count = (columns.len() * rows.len()) as f32;
        rows.map(|y| values[y * width + columns.start..y * width + columns.end].iter().sum::<f32>())
            .sum::<f32>()
            / count
    };
    (0..width * height).map(mean).collect()
}
