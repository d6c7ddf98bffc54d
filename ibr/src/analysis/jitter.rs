//! What errors of depth change in a view: it is rendered once more from depths with such errors.

use super::regressors::{difference, local_mean};
use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::pipeline::depth_errors::Lookups;
use crate::pipeline::{Geometry, RenderError, RenderSettings, Renderer};
use crate::propagate::{View, Viewpoint, nearest};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Errors of disparity below this many pixels change nothing that can be seen.
const LEAST_DISPARITY: f64 = 0.02;

/// Errors of depth below this share change nothing that can be seen.
const LEAST_SHARE: f64 = 1e-4;

/// Standard deviation of independent errors of the maps, from the maps alone: pixels of disparity for a
/// baseline of one, or shares of the depth. Points of one map are looked up in that of the nearest view
/// before it. 0 for a single view.
///
/// With two maps of the standard deviation s the difference has s^2 (1 + k): the second value is
/// interpolated, which leaves the share k of its variance, 2/3 between two neighbours and 4/9 between four.
/// The median makes hidden points harmless. Errors that both maps share, and offsets between the cameras, do
/// not show.
pub(super) fn map_noise<P: Viewpoint>(views: &[View<'_, P>]) -> f64 {
    let lookups = |j: usize| {
        let (a, b) = (&views[nearest(views, j, 0..j)?], &views[j]);
        Some(Lookups::of(a.map, b.map, a.camera.map_to(&b.camera)))
    };
    (1..views.len()).filter_map(lookups).fold(Lookups::default(), Lookups::and).common()
}

/// The views' maps with independent errors of this standard deviation, from a fixed seed: pixels of
/// disparity for a baseline of one, or shares of the depth.
pub fn with_noise<P>(views: &[View<'_, P>], deviation: f64, seed: u64) -> Vec<DepthMap> {
    let mut random = Pcg64::seed_from_u64(seed);
    // Nearly normal with the variance one, and bounded: the sum of three uniform numbers in [-1, 1).
    let mut part = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let mut error = || deviation * (2.0 * (part() + part() + part()) - 3.0);
    let mut noisy = |map: &DepthMap| match map.measure() {
        Measure::Disparity => map.changed(|d| d + error() as f32),
        Measure::Depth => map.changed(|d| d * (1.0 + error()) as f32),
    };
    views.iter().map(|v| noisy(v.map)).collect()
}

/// Local mean of the change of a view under errors of the maps with this standard deviation, in grey levels;
/// 0 for errors that change nothing that can be seen.
///
/// # Errors
/// Those of [`crate::pipeline`].
pub fn depth_jitter<P: Geometry>(
    views: &[View<'_, P>],
    camera: &P,
    settings: &RenderSettings,
    view: &Image,
    deviation: f64,
) -> Result<Vec<f32>, RenderError> {
    let is_disparity = views.first().is_some_and(|v| v.map.measure() == Measure::Disparity);
    if deviation < if is_disparity { LEAST_DISPARITY } else { LEAST_SHARE } {
        return Ok(vec![0.0; view.width() * view.height()]);
    }
    let maps = with_noise(views, deviation, 1);
    let noisy: Vec<_> = views.iter().zip(&maps).map(|(v, map)| View { map, ..*v }).collect();
    let changed = Renderer::new(&noisy, settings)?.render(camera, view.size())?.image;
    Ok(local_mean(&difference(&changed, view), view.size()))
}
