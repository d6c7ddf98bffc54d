//! The surfaces that the views see: meshes whose edges the photographs choose, and which of their
//! triangles no other photograph shows.

use super::reconstruction::Reconstruction;
use crate::camera::Relative;
use crate::image::Image;
use crate::pipeline::RenderError;
use crate::uncalibrated::Point;
use crate::uncalibrated::flips;
use crate::uncalibrated::mesh::{self, Feature, Mesh};
use rayon::prelude::*;

/// Difference of colours that counts at most, in grey levels: where another surface hides the point in the
/// other view, the difference says nothing.
const LARGEST_MISS: f64 = 30.0;

/// Times the median of all triangles from which on the mean difference of a triangle is unusual.
const UNUSUAL: f64 = 2.0;

/// Median in grey levels below which differences are noise.
const LEAST_USUAL: f64 = 2.0;

/// Views with which each one is compared, at most: those that share most points with it.
const MOST_OTHERS: usize = 4;

/// The surfaces that one view sees.
pub(super) struct Surface {
    mesh: Mesh,
    /// Triangles whose colours no other view shows at their place.
    doubtful: Vec<bool>,
}

impl Surface {
    /// chi at every pixel, NaN outside of the hull.
    pub(super) fn chi(&self, size: (usize, usize)) -> Vec<f64> {
        self.mesh.chi(size)
    }

    /// Whether each pixel lies in a doubtful triangle.
    pub(super) fn doubtful(&self, size: (usize, usize)) -> Vec<bool> {
        let mut doubtful = vec![false; size.0 * size.1];
        self.mesh.visit(size, |triangle, pixel, _| doubtful[pixel] |= self.doubtful[triangle]);
        doubtful
    }
}

/// The surfaces of each view. Where the `nearest` two share points their surfaces have no others: a point
/// that only one of them has bends its surface, and the two would show double images.
pub(super) fn surfaces(
    images: &[&Image],
    scene: &Reconstruction,
    nearest: [usize; 2],
) -> Result<Vec<Surface>, RenderError> {
    let grey: Vec<Image> = images.par_iter().map(|image| image.to_grey()).collect();
    let partner = |view: usize| match nearest {
        [a, b] if a == view => Some(b),
        [a, b] if b == view => Some(a),
        _ => None,
    };
    let surface = |view: usize| surface(&grey, scene, view, partner(view));
    let all: Vec<_> = (0..images.len()).into_par_iter().map(surface).collect();
    // Of several errors the first, for any number of threads.
    all.into_iter().collect()
}

fn surface(
    grey: &[Image],
    scene: &Reconstruction,
    view: usize,
    partner: Option<usize>,
) -> Result<Surface, RenderError> {
    let mut mesh = Mesh::delaunay(&features(scene, view, partner, grey[view].size()));
    let others = others(grey, scene, view)?;
    // A surface is right if one other view shows it: nearer ones may hide it in the rest.
    let miss = |p: &Point, chi: f64| {
        let own = value_at(&grey[view], p)?;
        let misses = others.iter().filter_map(|(image, map)| {
            let there = value_at(image, &transferred(map, p, chi)?)?;
            Some((there - own).abs().min(LARGEST_MISS))
        });
        misses.min_by(f64::total_cmp)
    };
    flips::exchange(&mut mesh, miss);
    let doubtful = unusual(&mean_misses(&mesh, grey[view].size(), miss));
    Ok(Surface { mesh, doubtful })
}

/// The features of a view, inside of the hull of those that it shares with its partner only these.
fn features(
    scene: &Reconstruction,
    view: usize,
    partner: Option<usize>,
    size: (usize, usize),
) -> Vec<Feature> {
    let all = scene.features(view);
    let Some(partner) = partner else { return all };
    let shared = scene.features_with(view, partner);
    let inside = mesh::dense_chi(&shared, size);
    let is_outside = |feature: &&Feature| {
        let (x, y) = (feature.position.x.round() as usize, feature.position.y.round() as usize);
        inside.get(y * size.0 + x).is_none_or(|chi| chi.is_nan())
    };
    let own: Vec<Feature> = all.iter().filter(is_outside).filter(|f| !shared.contains(f)).copied().collect();
    shared.into_iter().chain(own).collect()
}

/// The mean of `miss` over the pixels of each triangle, NaN for triangles without any.
fn mean_misses(mesh: &Mesh, size: (usize, usize), miss: impl Fn(&Point, f64) -> Option<f64>) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); mesh.triangles()];
    mesh.visit(size, |triangle, pixel, chi| {
        let p = Point::new((pixel % size.0) as f64, (pixel / size.0) as f64);
        if let Some(miss) = miss(&p, chi) {
            let (sum, count) = sums[triangle];
            sums[triangle] = (sum + miss, count + 1.0);
        }
    });
    sums.iter().map(|(sum, count)| sum / count).collect()
}

/// Which numbers are far above the median.
fn unusual(misses: &[f64]) -> Vec<bool> {
    let mut sorted: Vec<f64> = misses.iter().copied().filter(|m| m.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let limit = UNUSUAL * usual.max(LEAST_USUAL);
    misses.iter().map(|miss| *miss > limit).collect()
}

/// The views that share most points with one, and the maps to them.
fn others<'a>(
    grey: &'a [Image],
    scene: &Reconstruction,
    view: usize,
) -> Result<Vec<(&'a Image, Relative)>, RenderError> {
    let shared = |other: &usize| {
        scene.seen.iter().filter(|seen| seen[view].is_some() && seen[*other].is_some()).count()
    };
    let mut others: Vec<usize> = (0..grey.len()).filter(|i| *i != view).collect();
    others.sort_by_key(|other| std::cmp::Reverse(shared(other)));
    others.truncate(MOST_OTHERS);
    let source = scene.camera(view)?;
    let map = |other: usize| {
        let target = scene.camera(other)?;
        Ok((&grey[other], source.relative_to(&target)))
    };
    others.into_iter().map(map).collect()
}

/// The position in another view of a pixel with chi: X_p ~ \[Pi; e4\]^{-1} (x~, -chi), hence
/// Pi_v X_p = A x~ - chi b.
fn transferred(map: &Relative, p: &Point, chi: f64) -> Option<Point> {
    let q = map.a * p.push(1.0) - map.b * chi;
    (q.z > 0.0).then(|| q.xy() / q.z)
}

/// The value of a grey image between its pixels; `None` outside.
fn value_at(image: &Image, p: &Point) -> Option<f64> {
    Some(f64::from(image.value_at(p.x, p.y, 0))).filter(|value| !value.is_nan())
}
