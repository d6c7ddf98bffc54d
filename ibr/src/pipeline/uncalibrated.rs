//! A view from images and tracks alone (thesis 2.5).

use super::{RenderError, RenderSettings, Rendering, Report};
use crate::camera::{Camera, Relative};
use crate::image::Image;
use crate::interpolate::HoleCount;
use crate::interpolate::plane::{PlaneProblem, PlaneSettings};
use crate::occlusion::{self, DepthTest};
use crate::propagate::Frame;
use crate::sample::{Dropped, Sample};
use crate::uncalibrated::canonical::{CanonicalPair, canonical_pair};
use crate::uncalibrated::chirality::{self, Handedness};
use crate::uncalibrated::fundamental::{self, Fundamental};
use crate::uncalibrated::mesh::{self, Feature};
use crate::uncalibrated::metric::MetricGuess;
use crate::uncalibrated::resection::{Resection, Sighting, resect};
use crate::uncalibrated::triangulate::triangulate;
use crate::uncalibrated::{GeometryError, Match, Point, RobustSettings, metric};
use nalgebra::{Matrix3x4, Vector4};

/// Matches that a metric guess is made from: enough for one bit.
const GUESS_MATCHES: usize = 150;

/// Where the virtual camera is.
#[derive(Debug, Clone, PartialEq)]
pub enum Target {
    /// Where it sees the tracks: one place a track, `None` where not seen.
    Tracks(Vec<Option<Point>>),
    /// On the way from the first to the second view, 0 to 1, by the metric guess.
    Between(f64),
}

/// Settings of the uncalibrated pipeline besides those of the rendering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncalibratedSettings {
    /// The robust estimators.
    pub robust: RobustSettings,
    /// The bit that orders depth, if it is known; otherwise the metric guess decides.
    pub handedness: Option<Handedness>,
    /// Depth threshold of the occlusion test as a share of the range of chi. The meshes of two views bridge
    /// depth edges differently; a threshold below their disagreement removes samples that hide nothing.
    pub sigma_share: f64,
    /// The plane fit. Places from a mesh miss by fractions of a pixel, differently in each view, which reads
    /// like noise on the values: more bending than where depth is measured.
    pub plane: PlaneSettings,
}

impl Default for UncalibratedSettings {
    fn default() -> Self {
        let plane = PlaneSettings { stiffness: 0.02, bending: 0.3, ..PlaneSettings::default() };
        Self { robust: RobustSettings::default(), handedness: None, sigma_share: 0.2, plane }
    }
}

/// Why a view from tracks could not be rendered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UncalibratedError {
    /// The geometry could not be found.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The rendering failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// Images and track columns do not fit.
    #[error(
        "{images} images and {columns} columns of tracks for them: each of at least two views needs a column"
    )]
    Views {
        /// Images given.
        images: usize,
        /// Columns of tracks given.
        columns: usize,
    },
    /// A place between the views that is none.
    #[error("between = {between}: a place between the views is a number from 0 to 1")]
    Between {
        /// Value given.
        between: f64,
    },
}

/// What the geometry came to.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct GeometryReport {
    /// Matches between the first two views.
    pub matches: usize,
    /// Of these, in agreement with F.
    pub inliers: usize,
    /// Root mean square Sampson distance of the inliers in pixels.
    pub sampson_rms: f64,
    /// Places of the wanted view that the virtual camera was found from.
    pub sightings: usize,
    /// Of these, in agreement with it.
    pub resection_inliers: usize,
    /// Root mean square reprojection error of these in pixels.
    pub resection_rms: f64,
    /// Share of the metric guesses that agree on the order of depth; 1 if it was given.
    pub order_agreement: f64,
}

/// A rendered view and the region that could be rendered: the hull of the features as the virtual camera sees them.
#[derive(Debug, Clone, PartialEq)]
pub struct UncalibratedRendering {
    /// The view; black outside the region.
    pub rendering: Rendering,
    /// Whether a pixel lies in the region.
    pub region: Vec<bool>,
    /// The geometry behind it.
    pub geometry: GeometryReport,
    /// The bit that ordered depth.
    pub hand: Handedness,
}

/// Renders a view of `size` from images and `tracks[track][image]`.
///
/// The first two images carry the reconstruction; cameras of further ones are resected from the tracks.
///
/// # Errors
/// [`UncalibratedError`].
pub fn render(
    images: &[&Image],
    tracks: &[Vec<Option<Point>>],
    target: &Target,
    size: (usize, usize),
    settings: &RenderSettings,
    uncalibrated: &UncalibratedSettings,
) -> Result<UncalibratedRendering, UncalibratedError> {
    let columns = tracks.first().map_or(images.len(), Vec::len);
    if images.len() < 2 || columns != images.len() {
        return Err(UncalibratedError::Views { images: images.len(), columns });
    }
    settings.check()?;
    let scene = reconstruct(images, tracks, target, uncalibrated)?;
    let colour = images.iter().any(|i| i.channels() == 3);
    let render = if colour { render_with::<3> } else { render_with::<1> };
    Ok(render(images, &scene, size, settings, uncalibrated)?)
}

/// The scene in a projective frame: oriented cameras (the virtual one last) and points.
struct Reconstruction {
    cameras: Vec<Matrix3x4<f64>>,
    points: Vec<Vector4<f64>>,
    /// Places of the points in each image.
    seen: Vec<Vec<Option<Point>>>,
    hand: Handedness,
    geometry: GeometryReport,
}

fn reconstruct(
    images: &[&Image],
    tracks: &[Vec<Option<Point>>],
    target: &Target,
    settings: &UncalibratedSettings,
) -> Result<Reconstruction, UncalibratedError> {
    let base = Base::new(images, tracks, settings)?;
    let wanted = base.wanted(target)?;
    let last = images.len();
    let places =
        |(j, wanted): (&usize, &Option<Point>)| tracks[*j].iter().copied().chain([*wanted]).collect();
    let seen: Vec<Vec<Option<Point>>> = base.tracks.iter().zip(&wanted).map(places).collect();
    let mut cameras = base.cameras.to_vec();
    let mut resections = Vec::new();
    for column in 2..=last {
        let resection = resected(&base.points, &seen, column, settings)?;
        cameras.push(resection.camera);
        resections.push(resection);
    }
    let found = resections.last().ok_or(GeometryError::Numerical { what: "virtual camera" })?;
    let mut points = base.points.clone();
    chirality::orient(&mut cameras, &mut points, |i, j| seen[j][i].is_some());
    let (hand, order_agreement) = base.handedness(&points, &cameras[0], settings)?;
    let geometry = GeometryReport {
        matches: base.given,
        inliers: base.f.inliers.len(),
        sampson_rms: base.f.rms,
        sightings: wanted.iter().flatten().count(),
        resection_inliers: found.inliers.len(),
        resection_rms: found.rms,
        order_agreement,
    };
    Ok(Reconstruction { cameras, points, seen, hand, geometry })
}

/// The reconstruction of the first two views.
struct Base {
    /// Matches given.
    given: usize,
    f: Fundamental,
    sizes: [(usize, usize); 2],
    cameras: [Matrix3x4<f64>; 2],
    /// Tracks that agree with F and could be triangulated, with their matches and points.
    tracks: Vec<usize>,
    matches: Vec<Match>,
    points: Vec<Vector4<f64>>,
    guesses: Vec<MetricGuess>,
}

impl Base {
    fn new(
        images: &[&Image],
        tracks: &[Vec<Option<Point>>],
        settings: &UncalibratedSettings,
    ) -> Result<Self, GeometryError> {
        let numbered: Vec<(usize, Match)> = tracks
            .iter()
            .enumerate()
            .filter_map(|(j, t)| Some((j, Match { first: (*t.first()?)?, second: (*t.get(1)?)? })))
            .collect();
        let all: Vec<Match> = numbered.iter().map(|m| m.1).collect();
        let f = fundamental::robust(&all, &settings.robust)?;
        let agreeing: Vec<Match> = f.inliers.iter().map(|i| all[*i]).collect();
        let pair = canonical_pair(&f.matrix, &agreeing)?;
        let (tracks, matches, points) = triangulated(&pair, &numbered, &f);
        let cameras = [pair.first.inverse() * pair.cameras[0], pair.second.inverse() * pair.cameras[1]];
        let sizes = [images[0].size(), images[1].size()];
        let guesses = metric::guesses(&f.matrix, &some(&matches), sizes);
        Ok(Self { given: all.len(), f, sizes, cameras, tracks, matches, points, guesses })
    }

    /// Where the wanted view sees the points.
    fn wanted(&self, target: &Target) -> Result<Vec<Option<Point>>, UncalibratedError> {
        match target {
            Target::Tracks(places) => {
                Ok(self.tracks.iter().map(|j| places.get(*j).copied().flatten()).collect())
            }
            Target::Between(between) if (0.0..=1.0).contains(between) => {
                let guess = metric::best(&self.guesses)
                    .and_then(|g| metric::guess(&self.f.matrix, &self.matches, self.sizes, g.focal))
                    .ok_or(GeometryError::Numerical { what: "metric guess" })?;
                Ok(metric::images_between(&guess, &self.matches, *between))
            }
            Target::Between(between) => Err(UncalibratedError::Between { between: *between }),
        }
    }

    /// The bit that orders depth, given or by the guesses, and how many of these agree on it.
    fn handedness(
        &self,
        points: &[Vector4<f64>],
        camera: &Matrix3x4<f64>,
        settings: &UncalibratedSettings,
    ) -> Result<(Handedness, f64), GeometryError> {
        if let Some(hand) = settings.handedness {
            return Ok((hand, 1.0));
        }
        metric::handedness(&self.guesses, &some(&self.matches), &some(points), camera)
            .ok_or(GeometryError::Numerical { what: "order of depth" })
    }
}

/// Evenly spaced elements, as many as a metric guess needs.
fn some<T: Copy>(all: &[T]) -> Vec<T> {
    all.iter().copied().step_by(all.len().div_ceil(GUESS_MATCHES).max(1)).collect()
}

/// Points of the inliers that can be triangulated, with their track numbers and matches.
fn triangulated(
    pair: &CanonicalPair,
    numbered: &[(usize, Match)],
    f: &Fundamental,
) -> (Vec<usize>, Vec<Match>, Vec<Vector4<f64>>) {
    let mut all = (Vec::new(), Vec::new(), Vec::new());
    for (track, m) in f.inliers.iter().map(|i| numbered[*i]) {
        let (first, second) = (pair.first.apply(&m.first), pair.second.apply(&m.second));
        if let Some(x) = triangulate(&[(&pair.cameras[0], first), (&pair.cameras[1], second)]) {
            all.0.push(track);
            all.1.push(m);
            all.2.push(x);
        }
    }
    all
}

fn resected(
    points: &[Vector4<f64>],
    seen: &[Vec<Option<Point>>],
    column: usize,
    settings: &UncalibratedSettings,
) -> Result<Resection, GeometryError> {
    let sighting = |(point, places): (&Vector4<f64>, &Vec<Option<Point>>)| {
        Some(Sighting { point: *point, image: places[column]? })
    };
    let sightings: Vec<Sighting> = points.iter().zip(seen).filter_map(sighting).collect();
    resect(&sightings, &settings.robust)
}

fn camera(matrix: &Matrix3x4<f64>, which: impl Fn() -> String) -> Result<Camera, RenderError> {
    Camera::projective(*matrix)
        .map_err(|source| RenderError::Projective(GeometryError::Camera { which: which(), source }))
}

fn render_with<const C: usize>(
    images: &[&Image],
    scene: &Reconstruction,
    size: (usize, usize),
    settings: &RenderSettings,
    special: &UncalibratedSettings,
) -> Result<UncalibratedRendering, RenderError> {
    let target_matrix = &scene.cameras[images.len()];
    let target = camera(target_matrix, || "the virtual camera".into())?;
    let sign = chirality::order_sign(target_matrix, scene.hand);
    let frame = Frame::whole(size.0, size.1, 0.5, settings.offset);
    let mut report = Report::default();
    let mut samples: Vec<Sample<C>> = Vec::new();
    for (i, image) in images.iter().enumerate() {
        let source = camera(&scene.cameras[i], || format!("the camera of view {}", i + 1))?;
        let chi = mesh::dense_chi(&features(scene, i), image.size());
        let map = source.relative_to(&target);
        report.dropped += propagate_chi(image, &chi, i as u16, &map, sign, &frame, &mut samples);
    }
    report.propagated = samples.len();
    if samples.is_empty() {
        let pixels = images.iter().map(|i| i.width() * i.height()).sum();
        return Err(RenderError::NoOverlap { pixels, dropped: report.dropped });
    }
    let hull = hull_features(scene, images.len());
    let mut region: Vec<bool> = mesh::dense_chi(&hull, size).iter().map(|c| !c.is_nan()).collect();
    let absolute = special.sigma_share * chi_range(&hull);
    let test = DepthTest { relative: 0.0, absolute, ..*settings.depth_test() };
    test.check()?;
    report.occluded = occlusion::remove(&mut samples, &test);
    report.used = samples.len();
    let mut interpolation = settings.interpolation;
    interpolation.depth_test = test;
    interpolation.plane = special.plane;
    let mut problem = PlaneProblem::<C>::new(size, &interpolation)?;
    problem.add(&samples)?;
    problem.seen().zip(&mut region).for_each(|(seen, inside)| *inside |= seen);
    let fit = problem.solve(Some(&region))?;
    report.convergence = Some(fit.convergence);
    report.holes = HoleCount::of(&fit.mask);
    let image = Image::from_values(size, C, fit.values);
    let rendering = Rendering { image, mask: fit.mask, report };
    Ok(UncalibratedRendering { rendering, region, geometry: scene.geometry.clone(), hand: scene.hand })
}

/// The features of one view with their chi; points that do not lie in front of it are left out.
fn features(scene: &Reconstruction, view: usize) -> Vec<Feature> {
    let matrix = &scene.cameras[view];
    let feature = |(point, seen): (&Vector4<f64>, &Vec<Option<Point>>)| {
        let place = seen[view]?;
        let front = chirality::depth(matrix, point) > 0.0;
        front.then(|| Feature { place, chi: chirality::chi(matrix, point) })
    };
    scene.points.iter().zip(&scene.seen).filter_map(feature).collect()
}

/// All points as the virtual camera sees them.
fn hull_features(scene: &Reconstruction, target: usize) -> Vec<Feature> {
    let matrix = &scene.cameras[target];
    let feature = |point: &Vector4<f64>| {
        let p = matrix * point;
        (p.z > 0.0).then(|| Feature { place: p.xy() / p.z, chi: chirality::chi(matrix, point) })
    };
    scene.points.iter().filter_map(feature).collect()
}

/// The range from the 1st to the 99th percentile of chi.
fn chi_range(features: &[Feature]) -> f64 {
    let mut values: Vec<f64> = features.iter().map(|f| f.chi).filter(|c| c.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len() as f64 - 1.0) * share).round() as usize).copied();
    match (at(0.01), at(0.99)) {
        (Some(low), Some(high)) => high - low,
        _ => 0.0,
    }
}

/// Samples of one view from its dense chi: X_p ~ \[Pi; e4\]^{-1} (x~, -chi), hence Pi_v X_p = A x~ - chi b.
fn propagate_chi<const C: usize>(
    image: &Image,
    chi: &[f64],
    view: u16,
    map: &Relative,
    sign: f64,
    frame: &Frame,
    samples: &mut Vec<Sample<C>>,
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
            samples.push(Sample { x: u, y: v, depth, value, pixel: pixel as u32, view });
        } else {
            dropped.outside += 1;
        }
    }
    dropped
}
