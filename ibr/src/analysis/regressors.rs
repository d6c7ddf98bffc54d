//! What the error of a pixel is proportional to, cause by cause, in grey levels.

use super::Cause;
use super::evidence::PixelEvidence;
use super::variogram::Variogram;
use crate::image::Image;
use crate::interpolate::Cover;

/// Number of regressors.
pub(super) const REGRESSORS: usize = 7;

/// The regressors of one pixel: bias of the fit, noise, slope, jitter, edge, doubt, hole.
pub(super) type Regressors = [f64; REGRESSORS];

/// The cause that each regressor belongs to.
pub(super) const CAUSE_OF: [Cause; REGRESSORS] =
    [Cause::Density, Cause::Texture, Cause::Depth, Cause::Depth, Cause::Edges, Cause::Edges, Cause::Holes];

/// Distance in pixels over which a colour of doubtful depth is wrong, for the variogram.
const DOUBT: usize = 4;

/// The regressors of every pixel; `jitter` is the local change of the view under errors of
/// depth.
///
/// `spacing` is the distance between neighbouring views.
pub(super) fn regressors(
    found: &PixelEvidence,
    jitter: &[f32],
    variogram: &Variogram,
    spacing: f64,
) -> Vec<Regressors> {
    let image = &found.rendering.image;
    let distances = hole_distances(&found.rendering.mask, image.width());
    let slopes = slopes(image);
    let of_pixel = |p: usize| {
        if distances[p] > 0 {
            return [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, variogram.at(distances[p])];
        }
        let e = &found.evidence[p];
        // The noise of the photograph that a view is compared with adds to that of the views.
        let noise = (1.0 + f64::from(e.views)).sqrt();
        // Displacements of the samples: one part grows with the distance to the views, and one does not.
        let disparity_gain = f64::from(e.disparity_gain) / (spacing * spacing);
        let displacement = ((f64::from(e.views) + disparity_gain) / 2.0).sqrt();
        [
            f64::from(e.bias),
            noise,
            f64::from(slopes[p]) * displacement,
            f64::from(jitter[p]),
            f64::from(found.edges[p]),
            f64::from(e.doubtful) * variogram.at(DOUBT),
            0.0,
        ]
    };
    (0..found.evidence.len()).map(of_pixel).collect()
}

/// Slope of the image along the rows and columns in grey levels per pixel, mean over the channels.
pub(super) fn slopes(image: &Image) -> Vec<f32> {
    let (width, height) = image.size();
    let channels = image.channels();
    let at = |x: usize, y: usize, c: usize| image.data()[(y * width + x) * channels + c];
    let slope = |p: usize| {
        let (x, y) = (p % width, p / width);
        let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
        let (up, down) = (y.saturating_sub(1), (y + 1).min(height - 1));
        let of_channel = |c: usize| {
            let across = (at(right, y, c) - at(left, y, c)) / (right - left).max(1) as f32;
            let along = (at(x, down, c) - at(x, up, c)) / (down - up).max(1) as f32;
            across.hypot(0.5 * along)
        };
        (0..channels).map(of_channel).sum::<f32>() / channels as f32
    };
    (0..width * height).map(slope).collect()
}

/// Distance of every pixel of a hole to the nearest seen pixel of its row, 0 for seen pixels.
pub(super) fn hole_distances(mask: &[Cover], width: usize) -> Vec<usize> {
    let mut distances = vec![usize::MAX; mask.len()];
    for (row, mask) in distances.chunks_mut(width).zip(mask.chunks(width)) {
        let mut away = width;
        for x in 0..width {
            away = if !mask[x].is_hole() { 0 } else { away + 1 };
            row[x] = away;
        }
        away = width;
        for x in (0..width).rev() {
            away = if !mask[x].is_hole() { 0 } else { away + 1 };
            row[x] = row[x].min(away);
        }
    }
    distances
}

/// Half the side of the window over which the change is averaged, in pixels.
const WINDOW: usize = 2;

/// |a - b| of each pixel, mean over the channels; of the brightness, if only one image has colours.
pub(crate) fn difference(a: &Image, b: &Image) -> Vec<f32> {
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
