//! A view from images and tracks alone (thesis 2.5).

mod all_views;
mod base_pair;
mod colours;
mod morph;
mod reconstruction;
mod surface;

use super::{RenderError, RenderSettings, Rendering, Watch};
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
    /// Exchange near and far, whatever decides their order.
    pub reverse_order: bool,
}

impl Default for UncalibratedSettings {
    fn default() -> Self {
        Self { seed: 1, reverse_order: false }
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
    /// Share of the weight of the guessed calibrations that agree on the order of depth; 1 if it was given.
    pub order_agreement: f64,
    /// What decided the order of depth.
    pub order_by: OrderBy,
}

/// What decides which of two points on a ray is nearer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum OrderBy {
    /// The settings.
    Given,
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

/// Renders a view of `size` from images and `tracks[track][image]`.
///
/// The scene is reconstructed from two images first: the pair of most matches and parallax, or the first two
/// if the virtual camera lies between them. The cameras of further images are resected from the tracks, and
/// then all cameras and points are adjusted together. `watch` is called with the share of the work that is
/// done.
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
    watch: Watch<'_>,
) -> Result<UncalibratedRendering, RenderError> {
    let columns = tracks.first().map_or(images.len(), Vec::len);
    if images.len() < 2 || columns != images.len() {
        return Err(RenderError::Tracks { images: images.len(), columns });
    }
    settings.check()?;
    let numbers = match target {
        Target::Tracks(_) if images.len() > 2 => base_pair::order(tracks, columns, uncalibrated.seed),
        _ => (0..columns).collect(),
    };
    let images: &[&Image] = &numbers.iter().map(|i| images[*i]).collect::<Vec<_>>();
    // A row of another length was refused when the tracks were read.
    let reordered = |t: &Vec<Option<Point>>| numbers.iter().map(|i| t.get(*i).copied().flatten()).collect();
    let tracks: Vec<Vec<Option<Point>>> = tracks.iter().map(reordered).collect();
    let mut scene = reconstruction::reconstruct(images, &tracks, target, &numbers, uncalibrated.seed)?;
    scene.register(settings.offset);
    watch(0.4);
    let grey: Vec<Image> = images.par_iter().map(|image| image.to_grey()).collect();
    let of_view = |view: usize| Surface::of(view, images[view].size(), view, &grey, &scene);
    let surfaces: Vec<Surface> = (0..images.len()).into_par_iter().map(of_view).collect();
    watch(0.5);
    decide(images, &surfaces, &mut scene);
    if uncalibrated.reverse_order {
        scene.hand = scene.hand.reversed();
        (scene.geometry.order_by, scene.geometry.order_agreement) = (OrderBy::Given, 1.0);
    }
    watch(0.6);
    let view_weights = morph::view_weights(&surfaces[0].places);
    let surface = Surface::of(images.len(), size, view_weights.first_two()[0], &grey, &scene);
    drop(grey);
    watch(0.8);
    let render =
        if images.iter().any(|i| i.channels() == 3) { morph::render::<3> } else { morph::render::<1> };
    let leaves = settings.interpolation.fill == HoleFill::Leave;
    let done = render(images, &surface, &surfaces, &scene, &view_weights, size, leaves)?;
    watch(1.0);
    Ok(done)
}

/// Decides the order of depth from the photographs, which show what is in front, and the guessed
/// calibrations.
fn decide(images: &[&Image], surfaces: &[Surface], scene: &mut Reconstruction) {
    let guess = Order { hand: scene.hand, agreement: scene.geometry.order_agreement };
    (scene.hand, scene.geometry.order_by) = Advantage::of(images, surfaces, scene).order(&guess);
}

#[cfg(test)]
mod tests;
