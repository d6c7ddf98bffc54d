//! What the error of a rendered view comes from, cause by cause: the sizes are taken from the view, its
//! depths and its sample counts.

use super::estimate::{Examined, Study};
use super::jitter::depth_jitter;
use super::regressors::{regressors, slopes};
use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::pipeline::{Geometry, RenderError, RenderSettings, Renderer, ViewWeights};
use crate::propagate::{View, nearest};

/// The view of a camera with the regressors of its pixels; neighbouring views are `spacing` apart.
pub(super) fn examine<P: Geometry>(
    views: &[View<'_, P>],
    camera: &P,
    size: (usize, usize),
    study: &Study,
    spacing: f64,
) -> Result<Examined, RenderError> {
    let settings = &study.settings;
    let rendering = Renderer::new(views, settings)?.render(camera, size)?;
    let jitter = depth_jitter(views, camera, settings, &rendering.image, study.noise)?;
    let view_weights = ViewWeights::of(views, camera).with_noise(&rendering.agreement);
    let (shares, gain) = shares(views, camera, &view_weights);
    let gain = gain / (spacing * spacing);
    let image = &rendering.image;
    let (slopes, bends) = (slopes(image), bends(image));
    let edges = edges(image, &rendering.depth, settings);
    let of_seen = |p: usize| {
        // At most as many views share in a pixel as samples lie on it.
        let shares = f64::max(shares, 1.0 / f64::from(rendering.counts[p].max(1)));
        let displacement = ((shares + gain) / 2.0).sqrt();
        let slope = f64::from(slopes[p]) * displacement;
        // Samples of several views lie closer, and the error of a smooth texture is in proportion to their
        // distance squared. The noise of the photograph that a view is compared with adds to that of the
        // views.
        let (bend, noise) = (shares * f64::from(bends[p]), (1.0 + shares).sqrt());
        [bend, noise, slope, f64::from(jitter[p]), f64::from(edges[p]), 0.0]
    };
    let regressors = regressors(&rendering, &study.variogram, of_seen);
    Ok(Examined { rendering, regressors })
}

/// Mean distance between a view and the one nearest to it; of views at one point that from the camera, or
/// one.
pub(super) fn spacing<P: Geometry>(views: &[View<'_, P>], camera: &P) -> f64 {
    let distance = |i: usize| {
        let other = nearest(views, i, (0..views.len()).filter(|other| *other != i));
        other.map_or(f64::INFINITY, |other| views[other].camera.distance(&views[i].camera))
    };
    let mean = (0..views.len()).map(distance).sum::<f64>() / views.len() as f64;
    let away = views.iter().map(|v| v.camera.distance(camera)).fold(f64::INFINITY, f64::min);
    [mean, away].into_iter().find(|s| *s > 0.0 && s.is_finite()).unwrap_or(1.0)
}

/// Sum of the squared shares of the views in a pixel that all of them see, and the same times their squared
/// distances.
fn shares<P: Geometry>(views: &[View<'_, P>], camera: &P, view_weights: &ViewWeights) -> (f64, f64) {
    let weight = |i: usize| f64::from(view_weights.weight(i as u16));
    let total: f64 = (0..views.len()).map(weight).sum();
    let square = |i: usize| (weight(i) / total).powi(2);
    let away = |i: usize| views[i].camera.distance(camera).powi(2);
    ((0..views.len()).map(square).sum(), (0..views.len()).map(|i| square(i) * away(i)).sum())
}

/// (|f_xx| + |f_yy|) / 8, mean over the channels: the error of linear interpolation between samples a pixel
/// apart.
fn bends(image: &Image) -> Vec<f32> {
    let ((width, height), channels) = (image.size(), image.channels());
    let at = |x: usize, y: usize, c: usize| image.data()[(y * width + x) * channels + c];
    let bend = |p: usize| {
        let (x, y) = ((p % width).clamp(1, width.max(3) - 2), (p / width).clamp(1, height.max(3) - 2));
        let of_channel = |c: usize| {
            let middle = 2.0 * at(x, y, c);
            let across = (at(x - 1, y, c) - middle + at(x + 1, y, c)).abs();
            across + (at(x, y - 1, c) - middle + at(x, y + 1, c)).abs()
        };
        (0..channels).map(of_channel).sum::<f32>() / (8.0 * channels as f32)
    };
    if width < 3 || height < 3 {
        return vec![0.0; width * height];
    }
    (0..width * height).map(bend).collect()
}

/// Share of the height of a jump in its two pixels, which lie half a pixel away: 1 - 0.5 / 1.5.
const BESIDE: f32 = 2.0 / 3.0;

/// For pixels beside a jump of the rendered depth, the difference of the colours on both sides of it.
fn edges(image: &Image, depth: &DepthMap, settings: &RenderSettings) -> Vec<f32> {
    let ((width, height), channels) = (image.size(), image.channels());
    let test = settings.depth_test();
    let key = |value: f32| match depth.measure() {
        Measure::Depth => f64::from(value),
        Measure::Disparity => 1.0 / (f64::from(value) + depth.offset()),
    };
    let known = |p: usize| Some(key(depth.data()[p])).filter(|d| !d.is_nan());
    let mut edges = vec![0.0_f32; width * height];
    for p in 0..width * height {
        let across = (p % width + 1 < width).then_some((p + 1, 1));
        let down = (p / width + 1 < height).then_some((p + width, width));
        for (q, stride) in across.into_iter().chain(down) {
            let Some((a, b)) = known(p).zip(known(q)) else { continue };
            if !test.hides(a.min(b), a.max(b)) {
                continue;
            }
            // The pixels of the jump itself are mixed: compare those behind them.
            let (before, after) = (p.saturating_sub(stride), (q + stride).min(width * height - 1));
            let value = |p: usize, c: usize| image.data()[p * channels + c];
            let height = (0..channels).map(|c| (value(before, c) - value(after, c)).abs()).sum::<f32>();
            let beside = BESIDE * height / channels as f32;
            (edges[p], edges[q]) = (edges[p].max(beside), edges[q].max(beside));
        }
    }
    edges
}
