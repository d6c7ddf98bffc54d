//! The surfaces that a view sees: triangles between the points, whose edges the photographs choose.

use super::reconstruction::Reconstruction;
use crate::image::Image;
use crate::uncalibrated::Point;
use crate::uncalibrated::chirality;
use crate::uncalibrated::flips;
use crate::uncalibrated::mesh::{Mesh, Shares};
use nalgebra::{Matrix3x4, Vector4};

/// Difference of colours that counts at most, in grey levels: where another surface hides the point in the
/// other view, the difference says nothing.
const LARGEST_MISS: f32 = 30.0;

/// A triangulation of one image, and where its corners lie in all of them.
pub(super) struct Surface {
    pub(super) mesh: Mesh,
    /// Places of the corners in each image, the virtual one last.
    pub(super) places: Vec<Vec<Point>>,
    /// Their chi in the same images.
    chi: Vec<Vec<f64>>,
    /// Their projective depths in the same images.
    depths: Vec<Vec<f64>>,
}

impl Surface {
    /// The surface that image `view` of this size shows; `own` is the photograph with which the others are
    /// compared.
    pub(super) fn of(
        view: usize,
        size: (usize, usize),
        own: usize,
        grey: &[Image],
        scene: &Reconstruction,
    ) -> Self {
        let images = 0..scene.cameras.len();
        let points = points(view, size, scene);
        let place = |i: usize| points.iter().map(|j| scene.place(*j, i)).collect();
        let of_points = |i: usize, number: fn(&Matrix3x4<f64>, &Vector4<f64>) -> f64| -> Vec<f64> {
            points.iter().map(|j| number(&scene.cameras[i], &scene.points[*j])).collect()
        };
        let places: Vec<Vec<Point>> = images.clone().map(place).collect();
        let mut mesh = Mesh::delaunay(places[view].clone());
        let chi = images.clone().map(|i| of_points(i, chirality::chi)).collect();
        let depths = images.map(|i| of_points(i, chirality::depth)).collect();
        let surface = Self { mesh: mesh.clone(), places, chi, depths };
        // A surface is right if one other view shows it: nearer ones may hide it in the rest.
        flips::exchange(&mut mesh, |corner, shares| {
            let value = |i: usize| {
                let p = surface.place_at(i, corner, surface.carried(shares, corner, view, i));
                Some(grey[i].value_at(p.x, p.y, 0)).filter(|value| !value.is_nan())
            };
            let shown = value(own)?;
            let others = (0..grey.len()).filter(|i| *i != own).filter_map(value);
            let misses = others.map(|value| (value - shown).abs().min(LARGEST_MISS));
            misses.min_by(f32::total_cmp).map(f64::from)
        });
        Self { mesh, ..surface }
    }

    /// The shares in image `to` of a point that has `shares` of the corners in image `from`. They differ by
    /// the perspective of the triangle: with X = sum mu_k X_k, the share of a corner in an image is in
    /// proportion to mu_k times its depth there.
    pub(super) fn carried(&self, shares: Shares, corner: &[usize; 3], from: usize, to: usize) -> Shares {
        let part = |k: usize| shares[k] * self.depths[to][corner[k]] / self.depths[from][corner[k]];
        let parts = [0, 1, 2].map(part);
        parts.map(|part| part / parts.iter().sum::<f64>())
    }

    pub(super) fn chi_at(&self, image: usize, corner: &[usize; 3], shares: Shares) -> f64 {
        (0..3).map(|k| shares[k] * self.chi[image][corner[k]]).sum()
    }

    pub(super) fn place_at(&self, image: usize, corner: &[usize; 3], shares: Shares) -> Point {
        (0..3).map(|k| self.places[image][corner[k]] * shares[k]).sum()
    }

    /// A share of the range from the 1st to the 99th percentile of chi in an image.
    pub(super) fn chi_apart(&self, image: usize, share: f64) -> f64 {
        let mut chi = self.chi[image].clone();
        chi.sort_by(f64::total_cmp);
        let at = |share: f64| chi.get(((chi.len() as f64 - 1.0) * share).round() as usize).copied();
        share * (at(0.99).unwrap_or(0.0) - at(0.01).unwrap_or(0.0))
    }
}

/// The points in front of all cameras that an image shows, and others outside of their hull: inside it may
/// be hidden.
fn points(view: usize, size: (usize, usize), scene: &Reconstruction) -> Vec<usize> {
    let in_front = |j: &usize| {
        let point = &scene.points[*j];
        scene.cameras.iter().all(|camera| chirality::depth(camera, point) > 0.0)
    };
    let all = (0..scene.points.len()).filter(in_front);
    let (mut points, others): (Vec<usize>, Vec<usize>) = all.partition(|j| scene.seen[*j][view].is_some());
    let mut inside = vec![false; size.0 * size.1];
    let shown = Mesh::delaunay(points.iter().map(|j| scene.place(*j, view)).collect());
    shown.visit(&shown.corners, size, |pixel, _, _| inside[pixel] = true);
    points.extend(others.into_iter().filter(|j| {
        let p = scene.place(*j, view);
        let (x, y) = ((p.x + 0.5) as usize, (p.y + 0.5) as usize);
        x >= size.0 || inside.get(y * size.0 + x).is_none_or(|inside| !inside)
    }));
    points
}

/// The colour of an image between its pixels; `None` outside.
pub(super) fn colour_at<const C: usize>(image: &Image, p: &Point) -> Option<[f32; C]> {
    let value = |c: usize| image.cubic_at(p.x, p.y, c.min(image.channels() - 1));
    let colour = std::array::from_fn(value);
    colour.iter().all(|value| !value.is_nan()).then_some(colour)
}
