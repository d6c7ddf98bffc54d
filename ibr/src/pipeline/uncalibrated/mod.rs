//! A view from images and tracks alone (thesis 2.5).

mod colours;
mod morph;
mod reconstruction;
mod surface;

use super::{RenderError, RenderSettings, Rendering};
use crate::image::Image;
use crate::interpolate::HoleFill;
use crate::uncalibrated::Point;
use crate::uncalibrated::order::Order;
use colours::Advantage;
use rayon::prelude::*;
use reconstruction::Reconstruction;
use surface::Surface;

/// The virtual camera.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// Given by its image points: one position per track, `None` where the track is not seen.
    Tracks(Vec<Option<Point>>),
    /// Between the first and the second view, 0 to 1, by the metric guess.
    Between(f64),
}

/// Settings of the uncalibrated pipeline in addition to [`RenderSettings`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncalibratedSettings {
    /// Seed of the random samples of robust estimators: the same seed gives the same bits.
    pub seed: u64,
}

impl Default for UncalibratedSettings {
    fn default() -> Self {
        Self { seed: 1 }
    }
}

/// Figures of merit of the estimated geometry.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct GeometryReport {
    /// Matches between the first two views.
    pub matches: usize,
    /// Matches within the threshold of F.
    pub inliers: usize,
    /// Root mean square Sampson distance of the inliers in pixels.
    pub sampson_rms: f64,
    /// Points in the virtual view from which the virtual camera was estimated.
    pub sightings: usize,
    /// Sightings within the threshold of the virtual camera.
    pub resection_inliers: usize,
    /// Root mean square reprojection error of the inliers in pixels.
    pub resection_rms: f64,
    /// Share of the weight of the guessed calibrations that agree on the order of depth.
    pub order_agreement: f64,
    /// What decided the order of depth.
    pub order_by: OrderBy,
}

/// What decides which of two points on a ray is nearer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum OrderBy {
    /// Guessed calibrations, which agree.
    Calibrations,
    /// The photographs: where two points of one view fall on one pixel of the other, it shows the nearer.
    Colours,
    /// Photographs and guessed calibrations together; neither would suffice alone.
    Both,
    /// Neither: no surface hides another, and the photographs are blended where two lie on one ray.
    Nothing,
}

/// A rendered view and the region that could be rendered: the convex hull of the features in the virtual
/// view.
#[derive(Debug, Clone, PartialEq)]
pub struct UncalibratedRendering {
    /// The view; black outside the region.
    pub rendering: Rendering,
    /// Whether a pixel lies in the region.
    pub region: Vec<bool>,
    /// The estimated geometry.
    pub geometry: GeometryReport,
}

/// Renders a view of `size` from two images and `tracks[track][image]`.
///
/// # Errors
/// [`RenderError`].
pub fn render(
    images: &[&Image],
    tracks: &[Vec<Option<Point>>],
    target: &Target,
    size: (usize, usize),
    settings: &RenderSettings,
    uncalibrated: &UncalibratedSettings,
) -> Result<UncalibratedRendering, RenderError> {
    let columns = tracks.first().map_or(images.len(), Vec::len);
    if images.len() != 2 || columns != images.len() {
        return Err(RenderError::Tracks { images: images.len(), columns });
    }
    settings.check()?;
    let mut scene = reconstruction::reconstruct(images, tracks, target, uncalibrated.seed)?;
    scene.register(settings.offset);
    let grey: Vec<Image> = images.par_iter().map(|image| image.to_grey()).collect();
    let of_view = |view: usize| Surface::of(view, images[view].size(), view, &grey, &scene);
    let surfaces: Vec<Surface> = (0..images.len()).into_par_iter().map(of_view).collect();
    decide(images, &surfaces, &mut scene);
    let surface = Surface::of(images.len(), size, 0, &grey, &scene);
    drop(grey);
    let render =
        if images.iter().any(|i| i.channels() == 3) { morph::render::<3> } else { morph::render::<1> };
    let leaves = settings.interpolation.fill == HoleFill::Leave;
    render(images, &surface, &surfaces, &scene, size, leaves)
}

/// Decides the order of depth from the photographs, which show what is in front, and the guessed
/// calibrations.
fn decide(images: &[&Image], surfaces: &[Surface], scene: &mut Reconstruction) {
    let guess = Order { hand: scene.hand, agreement: scene.geometry.order_agreement };
    (scene.hand, scene.geometry.order_by) = Advantage::of(images, surfaces, scene).order(&guess);
}

#[cfg(test)]
mod tests;
