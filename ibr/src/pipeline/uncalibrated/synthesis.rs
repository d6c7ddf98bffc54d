//! The virtual view from a reconstructed scene: propagation by chi, occlusion removal, plane fit.

use super::UncalibratedRendering;
use super::base_pair::{matches, parallax};
use super::consistency::Surface;
use super::reconstruction::Reconstruction;
use crate::camera::Relative;
use crate::image::Image;
use crate::interpolate;
use crate::interpolate::plane::{PlaneProblem, PlaneSettings};
use crate::occlusion::{self, DepthTest};
use crate::pipeline::memory::Extent;
use crate::pipeline::{Agreement, RenderError, RenderSettings, Rendering, Report, ViewWeights, Watch};
use crate::propagate::Frame;
use crate::sample::{Dropped, Sample};
use crate::uncalibrated::Point;
use crate::uncalibrated::chirality;
use crate::uncalibrated::mesh::{self, Feature};
use nalgebra::Vector4;

/// Depth threshold of the occlusion test as a share of the range of chi. The meshes of two views interpolate
/// depth edges differently; a threshold below their difference would remove visible samples.
const SIGMA_SHARE: f64 = 0.2;

/// Share of the rendering, about, that is done when the visible samples are known.
const GATHERED: f64 = 0.4;

/// How the virtual view is rendered.
pub(super) struct Goal<'a> {
    pub(super) size: (usize, usize),
    pub(super) settings: &'a RenderSettings,
    pub(super) plane: PlaneSettings,
    pub(super) watch: Watch<'a>,
}

/// Renders the virtual view from the reconstructed scene.
pub(super) fn render<const ORDER: usize, const C: usize>(
    images: &[&Image],
    surfaces: &[Surface],
    scene: &Reconstruction,
    view_weights: &ViewWeights,
    goal: &Goal<'_>,
) -> Result<UncalibratedRendering, RenderError> {
    let Goal { size, settings, plane, watch } = *goal;
    let frame = Frame::whole(size.0, size.1, 0.5, settings.offset);
    let (mut samples, dropped) = propagated::<C>(images, surfaces, scene, &frame, goal)?;
    view_weights.apply(&mut samples);
    let mut report = Report { dropped, propagated: samples.len(), ..Report::default() };
    let hull = hull_features(scene, images.len());
    let absolute = SIGMA_SHARE * chi_range(&hull);
    let test = DepthTest { relative: 0.0, absolute, ..*settings.depth_test() };
    test.check()?;
    report.occluded = remove_occluded(&mut samples, &test);
    report.used = samples.len();
    let mut region: Vec<bool> = mesh::dense_chi(&hull, size).iter().map(|c| !c.is_nan()).collect();
    let interpolation = interpolate::Settings { depth_test: test, plane, ..settings.interpolation };
    watch(GATHERED);
    let mut problem = PlaneProblem::<ORDER, C>::new(size, &interpolation)?;
    problem.add(&samples)?;
    drop(samples);
    problem.seen().zip(&mut region).for_each(|(seen, inside)| *inside |= seen);
    let fit = problem.solve(Some(&region), &|share| watch(GATHERED + (1.0 - GATHERED) * share))?;
    let views = (0..images.len()).collect();
    let rendering = Rendering::of_plane::<C>(fit, report, views, Agreement::default());
    Ok(UncalibratedRendering { rendering, region, geometry: scene.geometry.clone() })
}

/// The samples of all views in the virtual one, and what was dropped. They are counted first, so that their
/// list, which takes most of the memory, holds no more than those that fall in the view.
fn propagated<const C: usize>(
    images: &[&Image],
    surfaces: &[Surface],
    scene: &Reconstruction,
    frame: &Frame,
    goal: &Goal<'_>,
) -> Result<(Vec<Sample<C>>, Dropped), RenderError> {
    let target = scene.camera(images.len())?;
    let sign = chirality::order_sign(&scene.cameras[images.len()], scene.hand);
    let of_view = |i: usize, with: &mut dyn FnMut(Sample<C>)| -> Result<Dropped, RenderError> {
        let (map, chi) = (scene.camera(i)?.relative_to(&target), surfaces[i].chi(images[i].size()));
        Ok(propagate_chi(images[i], &chi, i as u16, &map, sign, frame, with))
    };
    let (mut count, mut dropped) = (0, Dropped::default());
    for i in 0..images.len() {
        dropped += of_view(i, &mut |_| count += 1)?;
    }
    let extent = Extent { samples: count, ..Extent::new(goal.size, images, None) };
    if count == 0 {
        return Err(RenderError::NoOverlap { pixels: extent.pixels, dropped });
    }
    extent.check(extent.of_tracks(goal.plane.degree))?;
    let mut samples = Vec::with_capacity(count);
    for (i, surface) in surfaces.iter().enumerate() {
        let first = samples.len();
        of_view(i, &mut |sample| samples.push(sample))?;
        let doubtful = surface.doubtful(images[i].size());
        samples[first..].iter_mut().for_each(|s: &mut Sample<C>| s.doubtful = doubtful[s.pixel as usize]);
    }
    Ok((samples, dropped))
}

/// Removes what lies behind other samples. Doubtful samples hide doubtful ones only: a triangle that
/// bridges a depth edge lies before the surface that other views see there.
fn remove_occluded<const C: usize>(samples: &mut Vec<Sample<C>>, test: &DepthTest) -> usize {
    // In place, since the list may take most of the memory.
    samples.sort_unstable_by_key(|s| (s.doubtful, s.view, s.pixel));
    let (before, sound) = (samples.len(), samples.partition_point(|s| !s.doubtful));
    let mut hidden = occlusion::hidden(samples.iter().copied(), test);
    if sound < before {
        hidden[..sound].copy_from_slice(&occlusion::hidden(samples[..sound].iter().copied(), test));
    }
    let mut flags = hidden.into_iter();
    samples.retain(|_| flags.next() == Some(false));
    before - samples.len()
}

/// Weights of the views: near ones count more, those beyond the two nearest far less, all alike of two. The
/// distance of a view is the parallax between it and the virtual one, in pixels.
pub(super) fn view_weights(scene: &Reconstruction, target: usize) -> ViewWeights {
    if target == 2 {
        return ViewWeights::by_distance(&[1.0, 1.0]);
    }
    let positions: Vec<Vec<Option<Point>>> = scene
        .points
        .iter()
        .zip(&scene.seen)
        .map(|(point, seen)| {
            let p = scene.cameras[target] * point;
            let there = (p.z > 0.0).then(|| p.xy() / p.z);
            seen[..target].iter().copied().chain([there]).collect()
        })
        .collect();
    let distance = |view| parallax(&matches(&positions, view, target));
    let distances: Option<Vec<f64>> = (0..target).map(distance).collect();
    // Too few points for a distance: all views count alike.
    ViewWeights::by_distance(&distances.unwrap_or_else(|| vec![1.0; target])).faded()
}

/// All points in front of the virtual camera, projected into its image.
fn hull_features(scene: &Reconstruction, target: usize) -> Vec<Feature> {
    let matrix = &scene.cameras[target];
    let feature = |point: &Vector4<f64>| {
        let p = matrix * point;
        (p.z > 0.0).then(|| Feature { position: p.xy() / p.z, chi: chirality::chi(matrix, point) })
    };
    scene.points.iter().filter_map(feature).collect()
}

/// The range from the 1st to the 99th percentile of chi.
pub(super) fn chi_range(features: &[Feature]) -> f64 {
    let mut values: Vec<f64> = features.iter().map(|f| f.chi).filter(|c| c.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len() as f64 - 1.0) * share).round() as usize).copied();
    match (at(0.01), at(0.99)) {
        (Some(low), Some(high)) => high - low,
        _ => 0.0,
    }
}

/// Samples of one view from its dense chi: X_p ~ \[Pi; e4\]^{-1} (x~, -chi), hence Pi_v X_p = A x~ - chi b.
pub(super) fn propagate_chi<const C: usize>(
    image: &Image,
    chi: &[f64],
    view: u16,
    map: &Relative,
    sign: f64,
    frame: &Frame,
    mut with: impl FnMut(Sample<C>),
) -> Dropped {
    let mut dropped = Dropped::default();
    for (pixel, chi) in chi.iter().enumerate() {
        if chi.is_nan() {
            dropped.unknown += 1;
            continue;
        }
        let (x, y) = ((pixel % image.width()) as f64, (pixel / image.width()) as f64);
        let p = map.a * nalgebra::Vector3::new(x, y, 1.0) - map.b * *chi;
        let (u, v) = (p.x / p.z + frame.offset, p.y / p.z);
        if !(p.z > 0.0 && u.is_finite() && v.is_finite()) {
            dropped.behind += 1;
        } else if frame.holds(u, v) {
            let depth = (sign * chi / p.z) as f32;
            let value = image.pixel::<C>(pixel);
            let blank = Sample::BLANK;
            with(Sample { x: u, y: v, depth, value, pixel: pixel as u32, view, ..blank });
        } else {
            dropped.outside += 1;
        }
    }
    dropped
}
