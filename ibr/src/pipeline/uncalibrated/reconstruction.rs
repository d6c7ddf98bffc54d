//! Cameras and points of a scene from tracks, in a projective frame.

use super::{GeometryReport, OrderBy, Target};
use crate::camera::Camera;
use crate::image::Image;
use crate::pipeline::RenderError;
use crate::setting::SHARE;
use crate::uncalibrated::canonical::canonical_pair;
use crate::uncalibrated::chirality::{self, Handedness};
use crate::uncalibrated::fundamental::{self, Fundamental};
use crate::uncalibrated::metric;
use crate::uncalibrated::order::Order;
use crate::uncalibrated::resection::{REPROJECTION, Resection, Sighting, resect};
use crate::uncalibrated::triangulate::triangulate;
use crate::uncalibrated::{GeometryError, Match, Point};
use nalgebra::{Matrix3x4, Vector4};

/// Matches used for a metric guess; the order of depth, one bit, needs no more.
const GUESS_MATCHES: usize = 150;

/// Sampson distance in pixels up to which a match is a point of the scene. Those of more than a pixel do not
/// determine F, but a corner of the hull that is left out takes a large triangle with it.
const FARTHEST: f64 = 3.0;

/// The scene in a projective frame: oriented cameras (the virtual one last) and points.
pub(super) struct Reconstruction {
    pub(super) cameras: Vec<Matrix3x4<f64>>,
    pub(super) points: Vec<Vector4<f64>>,
    pub(super) seen: Vec<Vec<Option<Point>>>,
    pub(super) hand: Handedness,
    pub(super) geometry: GeometryReport,
}

impl Reconstruction {
    fn check(&self) -> Result<(), GeometryError> {
        self.cameras.iter().enumerate().try_for_each(|(view, camera)| {
            let which = match view {
                0 | 1 => format!("the camera of view {}", view + 1),
                _ => "the virtual camera".into(),
            };
            let checked = Camera::projective(*camera).map(|_| ());
            checked.map_err(|source| GeometryError::Camera { which, source })
        })
    }

    /// Moves the virtual view by some columns.
    pub(super) fn register(&mut self, columns: f64) {
        let target = self.cameras.len() - 1;
        let moved = self.cameras[target].row(0) + self.cameras[target].row(2) * columns;
        self.cameras[target].set_row(0, &moved);
        self.seen.iter_mut().filter_map(|seen| seen[target].as_mut()).for_each(|p| p.x += columns);
    }

    /// The place of a point in an image: where a photograph shows it, unless it projects elsewhere. In the
    /// virtual view it is where it projects, as the camera errs less than a position in one image.
    pub(super) fn place(&self, point: usize, image: usize) -> Point {
        let p = self.cameras[image] * self.points[point];
        let projected = p.xy() / p.z;
        let fits = |seen: &Point| image + 1 < self.cameras.len() && (seen - projected).norm() <= REPROJECTION;
        self.seen[point][image].filter(fits).unwrap_or(projected)
    }
}

/// Reconstructs the scene from two images and resects the virtual camera.
pub(super) fn reconstruct(
    images: &[&Image],
    tracks: &[Vec<Option<Point>>],
    target: &Target,
    seed: u64,
) -> Result<Reconstruction, RenderError> {
    let base = Base::new(images, tracks, seed)?;
    let in_target = base.points_in(target)?;
    let seen = with_target(base.tracks.iter().map(|j| &tracks[*j]), &in_target);
    let found = resected(&base.points, &seen, images.len(), seed)?;
    let mut cameras = base.cameras.to_vec();
    cameras.push(found.camera);
    let mut points = base.points.clone();
    chirality::orient(&mut cameras, &mut points, |i, j| seen[j][i].is_some());
    let order = Order::of(&base.f.matrix, &some(&base.matches), &some(&points), &cameras[0], base.sizes)
        .ok_or(GeometryError::Numerical { what: "order of depth" })?;
    let geometry = GeometryReport {
        matches: base.given,
        inliers: base.f.inliers.len(),
        sampson_rms: base.f.rms,
        sightings: in_target.iter().flatten().count(),
        resection_inliers: found.inliers.len(),
        resection_rms: found.rms,
        order_agreement: order.agreement,
        // Until the photographs have been asked.
        order_by: OrderBy::Nothing,
    };
    let scene = Reconstruction { cameras, points, seen, hand: order.hand, geometry };
    scene.check()?;
    Ok(scene)
}

fn with_target<'a>(
    tracks: impl Iterator<Item = &'a Vec<Option<Point>>>,
    target: &[Option<Point>],
) -> Vec<Vec<Option<Point>>> {
    tracks.zip(target).map(|(track, position)| track.iter().copied().chain([*position]).collect()).collect()
}

/// The reconstruction of the first two views.
struct Base {
    given: usize,
    f: Fundamental,
    sizes: [(usize, usize); 2],
    cameras: [Matrix3x4<f64>; 2],
    /// Tracks near F that could be triangulated, with their matches and points.
    tracks: Vec<usize>,
    matches: Vec<Match>,
    points: Vec<Vector4<f64>>,
}

impl Base {
    fn new(images: &[&Image], tracks: &[Vec<Option<Point>>], seed: u64) -> Result<Self, GeometryError> {
        let numbered: Vec<(usize, Match)> = tracks
            .iter()
            .enumerate()
            .filter_map(|(j, t)| Some((j, Match { first: (*t.first()?)?, second: (*t.get(1)?)? })))
            .collect();
        let all: Vec<Match> = numbered.iter().map(|m| m.1).collect();
        let f = fundamental::robust(&all, seed)?;
        let agreeing: Vec<Match> = f.inliers.iter().map(|i| all[*i]).collect();
        let pair = canonical_pair(&f.matrix, &agreeing)?;
        let near = |(_, m): &(usize, Match)| fundamental::sampson(&f.matrix, m) < FARTHEST * FARTHEST;
        let triangulated = |(track, m): (usize, Match)| {
            let (first, second) = (pair.first.apply(&m.first), pair.second.apply(&m.second));
            Some((track, m, triangulate(&[(&pair.cameras[0], first), (&pair.cameras[1], second)])?))
        };
        let (tracks, matches, points) =
            numbered.into_iter().filter(near).filter_map(triangulated).collect::<(Vec<_>, Vec<_>, Vec<_>)>();
        let cameras = [pair.first.inverse() * pair.cameras[0], pair.second.inverse() * pair.cameras[1]];
        let sizes = [images[0].size(), images[1].size()];
        Ok(Self { given: all.len(), f, sizes, cameras, tracks, matches, points })
    }

    fn points_in(&self, target: &Target) -> Result<Vec<Option<Point>>, RenderError> {
        match target {
            Target::Tracks(positions) => {
                Ok(self.tracks.iter().map(|j| positions.get(*j).copied().flatten()).collect())
            }
            Target::Between(between) => {
                SHARE.check("between", *between)?;
                let guess = metric::best(&self.f.matrix, &self.matches, self.sizes)
                    .ok_or(GeometryError::Numerical { what: "metric guess" })?;
                Ok(metric::images_between(&guess, &self.matches, *between))
            }
        }
    }
}

/// Evenly spaced elements, as many as a metric guess needs.
fn some<T: Copy>(all: &[T]) -> Vec<T> {
    all.iter().copied().step_by(all.len().div_ceil(GUESS_MATCHES).max(1)).collect()
}

fn resected(
    points: &[Vector4<f64>],
    seen: &[Vec<Option<Point>>],
    column: usize,
    seed: u64,
) -> Result<Resection, GeometryError> {
    let sighting = |(point, positions): (&Vector4<f64>, &Vec<Option<Point>>)| {
        Some(Sighting { point: *point, image: positions[column]? })
    };
    let sightings: Vec<Sighting> = points.iter().zip(seen).filter_map(sighting).collect();
    resect(&sightings, seed)
}
