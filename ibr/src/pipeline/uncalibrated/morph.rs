//! The virtual view from the photographs, triangle by triangle: each photograph is mapped as the plane of
//! the triangle maps it. Where the order of depth is clear, a photograph does not count where another of its
//! triangles lies before this one.

use super::UncalibratedRendering;
use super::base_pair::{matches, parallax};
use super::reconstruction::Reconstruction;
use super::surface::{Surface, colour_at};
use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::interpolate::{Cover, HoleCount};
use crate::pipeline::{Agreement, RenderError, Rendering, Report, ViewWeights};
use crate::sample::Dropped;
use crate::uncalibrated::Point;
use crate::uncalibrated::chirality;
use rayon::prelude::*;

/// Difference of depth from which on one triangle hides another, as a share of the range of chi: the
/// triangles beside a depth edge are slanted.
const SIGMA_SHARE: f64 = 0.2;

/// How the virtual view is rendered.
pub(super) struct Goal {
    pub(super) size: (usize, usize),
    /// Whether surfaces hide others. If not, all photographs count that show a pixel.
    pub(super) hides: bool,
    /// Whether pixels are left black that no photograph shows.
    pub(super) leave: bool,
}

/// Renders the virtual view.
pub(super) fn render<const C: usize>(
    images: &[&Image],
    surface: &Surface,
    scene: &Reconstruction,
    view_weights: &ViewWeights,
    goal: &Goal,
) -> Result<UncalibratedRendering, RenderError> {
    let (size, target, pixels) = (goal.size, images.len(), goal.size.0 * goal.size.1);
    let sign = |image: usize| chirality::order_sign(&scene.cameras[image], scene.hand);
    let front = |i: usize| Front::of(surface, i, images[i].size(), sign(i));
    let fronts: Vec<Front> =
        if goal.hides { (0..target).into_par_iter().map(front).collect() } else { vec![] };
    let (mut values, mut mask) = (vec![0.0; pixels * C], vec![Cover::Disocclusion; pixels]);
    let (mut region, mut depth) = (vec![false; pixels], vec![f32::NAN; pixels]);
    let (mut shown, mut visible) = (vec![0_u16; pixels], vec![0_u16; pixels]);
    surface.mesh.visit(&surface.places[target], size, |pixel, corner, shares| {
        let (mut all, mut seen) = (Blend::<C>::default(), Blend::<C>::default());
        for (i, image) in images.iter().enumerate() {
            let there = surface.carried(shares, corner, target, i);
            let place = surface.place_at(i, corner, there);
            let Some(colour) = colour_at(image, &place) else { continue };
            all.add(colour, view_weights.weight(i as u16));
            let own = sign(i) * surface.chi_at(i, corner, there);
            if fronts.get(i).is_none_or(|front| !front.hides(&place, own)) {
                seen.add(colour, view_weights.weight(i as u16));
            }
        }
        region[pixel] = true;
        (shown[pixel], visible[pixel]) = (all.count, seen.count);
        if seen.count > 0 {
            mask[pixel] = Cover::Seen;
            depth[pixel] = (sign(target) * surface.chi_at(target, corner, shares)) as f32;
        }
        let filled = all.mean().filter(|_| !goal.leave);
        values[pixel * C..(pixel + 1) * C].copy_from_slice(&seen.mean().or(filled).unwrap_or([0.0; C]));
    });
    let beside = region.iter().filter(|inside| !**inside).count();
    region.iter_mut().zip(&shown).for_each(|(inside, count)| *inside &= *count > 0);
    let sum = |counts: &[u16]| counts.iter().map(|count| usize::from(*count)).sum::<usize>();
    let (propagated, used) = (sum(&shown), sum(&visible));
    // Each photograph is asked for each pixel.
    let unknown = target * beside;
    let dropped = Dropped { unknown, behind: 0, outside: target * pixels - unknown - propagated };
    if propagated == 0 {
        return Err(RenderError::NoOverlap { pixels: target * pixels, dropped });
    }
    let holes = HoleCount::of(&mask);
    let (occluded, convergence) = (propagated - used, None);
    let rendering = Rendering {
        image: Image::from_values(size, C, values),
        mask,
        depth: DepthMap::from_known(size, depth, Measure::Depth),
        counts: visible,
        views: (0..target).collect(),
        report: Report { dropped, propagated, occluded, used, holes, convergence },
        agreement: Agreement::default(),
    };
    Ok(UncalibratedRendering { rendering, region, geometry: scene.geometry.clone() })
}

/// A weighted mean of colours.
struct Blend<const C: usize> {
    sum: [f32; C],
    weight: f32,
    count: u16,
}

impl<const C: usize> Default for Blend<C> {
    fn default() -> Self {
        Self { sum: [0.0; C], weight: 0.0, count: 0 }
    }
}

impl<const C: usize> Blend<C> {
    fn add(&mut self, colour: [f32; C], weight: f32) {
        self.sum.iter_mut().zip(colour).for_each(|(sum, value)| *sum += weight * value);
        self.weight += weight;
        self.count += 1;
    }

    fn mean(&self) -> Option<[f32; C]> {
        (self.weight > 0.0).then(|| self.sum.map(|sum| sum / self.weight))
    }
}

/// The depths of the triangles that lie in front in one photograph.
struct Front {
    width: usize,
    depth: Vec<f32>,
    /// The difference from which on a triangle is hidden.
    apart: f64,
}

impl Front {
    fn of(surface: &Surface, image: usize, size: (usize, usize), sign: f64) -> Self {
        let mut depth = vec![f32::INFINITY; size.0 * size.1];
        surface.mesh.visit(&surface.places[image], size, |pixel, corner, shares| {
            let own = (sign * surface.chi_at(image, corner, shares)) as f32;
            depth[pixel] = depth[pixel].min(own);
        });
        Self { width: size.0, depth, apart: surface.chi_apart(image, SIGMA_SHARE) }
    }

    fn hides(&self, place: &Point, depth: f64) -> bool {
        let pixel = (place.y + 0.5) as usize * self.width + (place.x + 0.5) as usize;
        self.depth.get(pixel).is_some_and(|front| depth > f64::from(*front) + self.apart)
    }
}

/// Weights of the views: near ones count more, those beyond the two nearest far less, all alike of two. The
/// distance of a view is the parallax between it and the virtual one, in pixels.
pub(super) fn view_weights(surface: &[Vec<Point>]) -> ViewWeights {
    let Some((there, views)) = surface.split_last().filter(|(_, views)| views.len() > 2) else {
        return ViewWeights::by_distance(&[1.0, 1.0]);
    };
    let pairs = |view: &Vec<Point>| -> Vec<Vec<Option<Point>>> {
        view.iter().zip(there).map(|(p, q)| vec![Some(*p), Some(*q)]).collect()
    };
    let distances: Option<Vec<f64>> =
        views.iter().map(|view| parallax(&matches(&pairs(view), 0, 1))).collect();
    // Too few points for a distance: all views count alike.
    ViewWeights::by_distance(&distances.unwrap_or_else(|| vec![1.0; views.len()])).faded()
}
