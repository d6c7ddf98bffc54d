//! What the error of a pixel is proportional to, cause by cause, in grey levels.

use super::Cause;
use super::variogram::Variogram;
use crate::image::Image;
use crate::interpolate::Cover;
use crate::pipeline::Rendering;

/// Number of regressors.
pub(super) const REGRESSORS: usize = 6;

/// The regressors of one pixel: bend, noise, slope, jitter, edge, hole.
pub(super) type Regressors = [f64; REGRESSORS];

/// The cause that each regressor belongs to.
pub(super) const CAUSE_OF: [Cause; REGRESSORS] =
    [Cause::Density, Cause::Texture, Cause::Depth, Cause::Depth, Cause::Edges, Cause::Holes];

/// The regressors of every pixel of a rendering; `of_seen` gives those of a pixel that is in no hole.
pub(super) fn regressors(
    rendering: &Rendering,
    variogram: &Variogram,
    of_seen: impl Fn(usize) -> Regressors,
) -> Vec<Regressors> {
    let distances = hole_distances(&rendering.mask, rendering.image.width());
    let of_pixel = |(p, away): (usize, &usize)| match away {
        0 => of_seen(p),
        away => [0.0, 0.0, 0.0, 0.0, 0.0, variogram.at(*away)],
    };
    distances.iter().enumerate().map(of_pixel).collect()
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
fn hole_distances(mask: &[Cover], width: usize) -> Vec<usize> {
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
