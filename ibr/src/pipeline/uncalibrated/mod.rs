//! A view from images and tracks alone (thesis 2.5).

mod all_views;
mod base_pair;
mod colours;
mod consistency;
mod reconstruction;
mod synthesis;

use super::memory::Extent;
use super::{RenderError, RenderSettings, Rendering, Watch};
use crate::image::Image;
use crate::interpolate::Degree;
use crate::interpolate::plane::PlaneSettings;
use crate::uncalibrated::Point;
use crate::uncalibrated::order::Order;
use colours::Advantage;
use consistency::Surface;
use reconstruction::Reconstruction;
use synthesis::Goal;

/// Shares of the work, about, that are done when the scene is reconstructed, when its surfaces are meshed,
/// and when the order of depth is decided.
const RECONSTRUCTED: f64 = 0.4;
const SURFACES: f64 = 0.5;
const DECIDED: f64 = 0.55;

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
    /// The plane fit. Positions from a mesh are wrong by fractions of a pixel, differently in each view,
    /// which acts like noise on the values; so bending has more weight than for measured depth.
    pub plane: PlaneSettings,
}

impl Default for UncalibratedSettings {
    fn default() -> Self {
        let plane = PlaneSettings { stiffness: 0.02, bending: 0.3, ..PlaneSettings::LINEAR };
        Self { seed: 1, reverse_order: false, plane }
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
pub enum OrderBy {
    /// The settings.
    Given,
    /// Guessed calibrations, which agree.
    Calibrations,
    /// The photographs: where two points of one view fall on one pixel of the other, it shows the nearer.
    Colours,
    /// Photographs and guessed calibrations together; neither would suffice alone.
    Both,
    /// Neither; the order of more guesses was taken.
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
    // How many samples fall in the view is known when the scene is reconstructed.
    let extent = Extent { samples: 0, ..Extent::new(size, images, None) };
    extent.check(extent.of_tracks(uncalibrated.plane.degree))?;
    let numbers = match target {
        Target::Tracks(_) if images.len() > 2 => base_pair::order(tracks, columns, uncalibrated.seed),
        _ => (0..columns).collect(),
    };
    let images: &[&Image] = &numbers.iter().map(|i| images[*i]).collect::<Vec<_>>();
    // A row of another length was refused when the tracks were read.
    let reordered = |t: &Vec<Option<Point>>| numbers.iter().map(|i| t.get(*i).copied().flatten()).collect();
    let tracks: Vec<Vec<Option<Point>>> = tracks.iter().map(reordered).collect();
    let mut scene = reconstruction::reconstruct(images, &tracks, target, uncalibrated.seed)?;
    scene.numbers = numbers;
    watch(RECONSTRUCTED);
    let view_weights = synthesis::view_weights(&scene, images.len());
    let surfaces = consistency::surfaces(images, &scene, view_weights.first_two())?;
    watch(SURFACES);
    decide(images, &surfaces, &mut scene)?;
    if uncalibrated.reverse_order {
        scene.hand = scene.hand.reversed();
        (scene.geometry.order_by, scene.geometry.order_agreement) = (OrderBy::Given, 1.0);
    }
    watch(DECIDED);
    let rest = |share| watch(DECIDED + (1.0 - DECIDED) * share);
    let colour = images.iter().any(|i| i.channels() == 3);
    let render = match (uncalibrated.plane.degree, colour) {
        (Degree::Linear, false) => synthesis::render::<2, 1>,
        (Degree::Linear, true) => synthesis::render::<2, 3>,
        (Degree::Cubic, false) => synthesis::render::<4, 1>,
        (Degree::Cubic, true) => synthesis::render::<4, 3>,
    };
    let goal = Goal { size, settings, plane: uncalibrated.plane, watch: &rest };
    render(images, &surfaces, &scene, &view_weights, &goal)
}

/// Decides the order of depth from the photographs, which show what is in front, and the guessed
/// calibrations.
fn decide(images: &[&Image], surfaces: &[Surface], scene: &mut Reconstruction) -> Result<(), RenderError> {
    let guess = Order { hand: scene.hand, agreement: scene.geometry.order_agreement };
    let decided = Advantage::of(images, surfaces, scene)?.order(&guess);
    (scene.hand, scene.geometry.order_by) = decided;
    Ok(())
}

#[cfg(test)]
mod tests;
