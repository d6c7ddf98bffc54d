//! Restoration of depth maps before the three stages: depth as cameras, matchers and lidar give it has
//! outliers and noise.
//!
//! Everything is done in parallax, that is disparity or reciprocal depth, in which planes are affine and the
//! errors of matchers are white.
//!
//! 1. *Outliers.* A value is rejected if it contradicts its neighbours and the other views do not outvote
//!    them (`outliers`). It takes the median of its neighbours, weighed by the likeness of their colours;
//!    so do the values around it in maps of rigs.
//! 2. *Noise.* With the standard deviation delta of the errors, which
//!    [`Agreement`](crate::pipeline::Agreement) finds from the lookups of one map in another, and the bends
//!    kappa of the surfaces, the map is the most probable one of a random walk of slopes (`surface`).
//!
//! A median of the maps alone removes outliers too, and costs 1.5 dB on thin structures. Views share their
//! scattered samples: on bars 1.5 pixels wide, which samples 6 pixels apart miss, that gains 5 dB.
//!
//! Samples are not weighed by the errors of their depth: weights by the slope of the photograph gave 0.2 dB
//! for Cones with errors of 1 px in one map, and restoring the map gives 1.5 dB more.

mod outliers;
mod scattered;
mod surface;

pub(crate) use scattered::dense;
pub(crate) use surface::from_scattered;

use crate::depth::{DepthMap, Measure};
use crate::propagate::{View, Viewpoint, nearest};
use outliers::Known;

/// A map that was restored.
#[derive(Debug, Clone, PartialEq)]
pub struct Restored {
    /// The map.
    pub map: DepthMap,
    /// Share of its values that were outliers.
    pub outliers: f64,
    /// Standard deviation of the errors that it had: pixels of disparity for a baseline of one, or shares of
    /// the depth. 0 if they were not measured, for want of another view.
    pub error: f64,
}

/// Mean square displacement in pixels from which on errors are smoothed: a fiftieth of the variance of a
/// position within a pixel.
const NOTICEABLE: f64 = 0.02 / 12.0;

/// Restores the maps of views that see one scene.
pub fn restore<P: Viewpoint>(views: &[View<'_, P>]) -> Vec<Restored> {
    let all = Known::of(views);
    let one = |i: usize| {
        let (view, error, rejected) = (&views[i], all.agreement.depth_error(i), all.rejected(i));
        let (mut plane, count) = (all.planes[i].clone(), rejected.iter().filter(|r| **r).count());
        if count > 0 {
            plane.replace(view.image, &rejected);
            if view.map.measure() == Measure::Disparity {
                plane.sharpen(view.image, &rejected);
            }
        }
        if is_noticeable(views, i, error) {
            plane.smooth(view.image, view.map.measure());
        }
        let known = (plane.values.len() - view.map.unknown()).max(1);
        let replaced = if count > 0 { rejected } else { Vec::new() };
        let map = plane.into_map(view.map, replaced);
        Restored { map, outliers: count as f64 / known as f64, error }
    };
    (0..views.len()).map(one).collect()
}

/// Whether errors of a map displace its samples by more than the fit notices, in the nearest view from
/// another place.
fn is_noticeable<P: Viewpoint>(views: &[View<'_, P>], view: usize, error: f64) -> bool {
    let is_elsewhere = |other: &usize| views[*other].camera.distance(&views[view].camera) > 0.0;
    let other = nearest(views, view, (0..views.len()).filter(is_elsewhere));
    let Some(other) = other.filter(|_| error > 0.0) else { return false };
    displacement(&views[view], &views[other].camera) * error * error > NOTICEABLE
}

/// Mean square displacement of the points of a view in another one by an error of one in its map, a pixel of
/// disparity or the whole depth. The points that move farthest, a tenth, are left out: those close to a
/// camera move without limit.
fn displacement<P: Viewpoint>(view: &View<'_, P>, camera: &P) -> f64 {
    const CHANGE: f64 = 1e-3;
    const STEPS: usize = 16;
    let (map, to) = (view.map, view.camera.map_to(camera));
    let (width, height) = map.size();
    let columns = (0..width).step_by(width.div_ceil(STEPS).max(1));
    let rows = (0..height).step_by(height.div_ceil(STEPS).max(1));
    let square = |(x, y): (usize, usize)| {
        let value = f64::from(map.row(y)[x]);
        let wrong = match map.measure() {
            Measure::Disparity => value + CHANGE,
            Measure::Depth => value * (1.0 + CHANGE),
        };
        let [(a, b, _), (c, d, _)] = [value, wrong].map(|value| to(x as f64, y as f64, value));
        Some(((c - a).powi(2) + (d - b).powi(2)) / (CHANGE * CHANGE)).filter(|square| square.is_finite())
    };
    let pixels = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
    let mut squares: Vec<f64> = pixels.filter_map(square).collect();
    squares.sort_by(f64::total_cmp);
    squares.truncate(squares.len() - squares.len() / 10);
    squares.iter().sum::<f64>() / squares.len().max(1) as f64
}

#[cfg(test)]
mod tests;
