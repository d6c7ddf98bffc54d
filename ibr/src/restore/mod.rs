//! Restoration of depth maps before the three stages: depth as cameras, matchers and lidar give it has
//! outliers and noise.
//!
//! Everything is done in parallax, that is disparity or reciprocal depth, in which planes are affine and the
//! errors of matchers are white.
//!
//! 1. *Outliers.* A value is rejected if it contradicts its neighbours and the other views
//!    ([`outliers`]), and takes the median of its neighbours, weighed by the likeness of their colours.
//! 2. *Noise.* With the standard deviation delta of the errors, which
//!    [`Agreement`](crate::pipeline::Agreement) finds from the lookups of one map in another, and the bends
//!    kappa of the surfaces, the map is the most probable one of a random walk of slopes ([`surface`]).

mod colour;
mod outliers;
mod surface;

pub use colour::coloured;
pub(crate) use surface::from_scattered;

use crate::depth::{DepthMap, Measure};
use crate::pipeline::{APERTURE, Agreement, DisparityGain, NEGLIGIBLE};
use crate::propagate::{Nearest, View, Viewpoint};
use outliers::Parallax;

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

/// Restores the maps of views that see one scene.
pub fn restore<P: Viewpoint>(views: &[View<'_, P>]) -> Vec<Restored> {
    let agreement = Agreement::of(views);
    let error = |view: usize| agreement.depth_error(view);
    let planes: Vec<Parallax> =
        views.iter().enumerate().map(|(i, v)| Parallax::of(v.map, error(i))).collect();
    let nearest = Nearest::new(views);
    let one = |i: usize| {
        let view = &views[i];
        let rejected = outliers::rejected(views, &planes, &agreement.gains, i);
        let count = rejected.iter().filter(|r| **r).count();
        let mut plane = planes[i].clone();
        let mut guessed = Vec::new();
        if count > 0 {
            plane.replace(view.image, &rejected);
            guessed = rejected;
        }
        if is_noticeable(views, i, nearest.other(i), error(i)) {
            plane.smooth(view.image);
        }
        let known = (plane.values.len() - view.map.unknown()).max(1);
        Restored {
            map: plane.into_map(view.map, guessed),
            outliers: count as f64 / known as f64,
            error: error(i),
        }
    };
    (0..views.len()).map(one).collect()
}

/// Whether errors of a map displace its samples by more than the fit notices, in the nearest other view.
fn is_noticeable<P: Viewpoint>(views: &[View<'_, P>], view: usize, other: Option<usize>, error: f64) -> bool {
    let Some(other) = other.filter(|_| error > 0.0) else { return false };
    let (from, to) = (&views[view], &views[other]);
    let gain = match from.map.measure() {
        Measure::Disparity => DisparityGain::along_rows(from.camera.distance(&to.camera)),
        Measure::Depth => DisparityGain::of(from.map, from.camera.map_to(&to.camera)),
    };
    gain.product([1.0, 0.0, 1.0]) * error * error > NEGLIGIBLE * APERTURE
}

#[cfg(test)]
mod tests;
