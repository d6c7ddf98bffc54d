//! The virtual view from the photographs, triangle by triangle: each photograph is mapped as the plane of
//! the triangle maps it.
//!
//! A triangle that joins two surfaces lies on neither of them. Where the photographs contradict each other
//! on its plane and agree on that of a triangle beside it, the pixel lies on that one. A photograph that
//! shows another surface before the point, by the order of depth, counts less there.
//!
//! Samples with depths of their own for each photograph, with occlusion removal and a spline fit, gave
//! double images where two meshes differ: up to 2.4 dB less than the mean of affine Delaunay triangles.

use super::reconstruction::Reconstruction;
use super::surface::{Surface, colour_at};
use super::{OrderBy, UncalibratedRendering};
use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::interpolate::{Cover, HoleCount};
use crate::pipeline::{Agreement, RenderError, Rendering, Report};
use crate::sample::Dropped;
use crate::uncalibrated::Point;
use crate::uncalibrated::chirality;
use crate::uncalibrated::mesh::{Edge, Facet, Shares, edges, visit_triangle};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Difference of two photographs in grey levels from which on they contradict each other, and how many times
/// less it is on the plane of a triangle beside. With 5 to 15 levels and 2 to 3 times, the pairs of
/// `tests/morph` change by 0.1 dB at most.
const CONTRADICTION: f32 = 10.0;
const TIMES_BETTER: f32 = 2.0;

/// Where two photographs are compared for the plane of a pixel, in pixels from it: a single one agrees by
/// chance. With 3 to 6 pixels the pairs change by 0.2 dB at most.
const AROUND: [[f64; 2]; 5] = [[0.0, 0.0], [4.0, 0.0], [-4.0, 0.0], [0.0, 4.0], [0.0, -4.0]];

/// Difference of depth from which on one triangle hides another, as a share of the range of chi: the
/// triangles beside a depth edge are slanted.
const SIGMA_SHARE: f64 = 0.2;

/// What a photograph counts where another surface hides the point. The meshes err most where surfaces meet:
/// without these photographs the pairs of `tests/views/morph` lose up to 0.4 dB, and where tracks follow the
/// outlines a fifth is nearly as good as nothing.
const HIDDEN_WEIGHT: f32 = 0.2;

/// Renders the virtual view of `size` from the surfaces of that view and of each photograph. If `leaves`,
/// pixels stay black that all photographs show hidden.
pub(super) fn render<const C: usize>(
    images: &[&Image],
    surface: &Surface,
    shown: &[Surface],
    scene: &Reconstruction,
    size: (usize, usize),
    leaves: bool,
) -> Result<UncalibratedRendering, RenderError> {
    let painter = Painter::new(images, surface, shown, scene);
    let (target, pixels) = (images.len(), size.0 * size.1);
    let (mut values, mut mask) = (vec![0.0; pixels * C], vec![Cover::Disocclusion; pixels]);
    let (mut region, mut depth) = (vec![false; pixels], vec![f32::NAN; pixels]);
    let (mut visited, mut visible, mut propagated) = (vec![false; pixels], vec![0_u16; pixels], 0);
    let sides = surface.mesh.sides();
    for triangle in 0..surface.mesh.triangles.len() {
        let planes = painter.planes(triangle, &sides);
        let Some(own) = planes.first() else { continue };
        visit_triangle(&painter.places(&own.corner), size, |pixel, _| {
            // On the edge of a triangle that came before.
            if std::mem::replace(&mut visited[pixel], true) {
                return;
            }
            let position = Point::new((pixel % size.0) as f64, (pixel / size.0) as f64);
            let plane = painter.plane_at::<C>(&planes, &position);
            let blend: Blend<C> = painter.blend(plane, &position);
            propagated += usize::from(blend.shown);
            visible[pixel] = blend.visible;
            region[pixel] = blend.shown > 0;
            if blend.visible > 0 {
                mask[pixel] = Cover::Seen;
                depth[pixel] = painter.depth(plane, &position) as f32;
            }
            if blend.visible > 0 || !leaves {
                values[pixel * C..(pixel + 1) * C].copy_from_slice(&blend.mean());
            }
        });
    }
    // Each photograph is asked for each pixel.
    let inside = visited.iter().filter(|visited| **visited).count();
    let unknown = target * (pixels - inside);
    let dropped = Dropped { unknown, behind: 0, outside: target * inside - propagated };
    if propagated == 0 {
        return Err(RenderError::NoOverlap { pixels: target * pixels, dropped });
    }
    let used = visible.iter().map(|count| usize::from(*count)).sum::<usize>();
    let (holes, convergence) = (HoleCount::of(&mask), None);
    let rendering = Rendering {
        image: Image::from_values(size, C, values),
        mask,
        depth: DepthMap::from_known(size, depth, Measure::Depth),
        counts: visible,
        views: (0..target).collect(),
        report: Report { dropped, propagated, occluded: propagated - used, used, holes, convergence },
        agreement: Agreement::default(),
    };
    Ok(UncalibratedRendering { rendering, region, geometry: scene.geometry.clone() })
}

struct Plane {
    corner: [usize; 3],
    facet: Facet,
}

struct Painter<'a> {
    images: &'a [&'a Image],
    surface: &'a Surface,
    /// The signs of chi by which the nearer one of two points has the smaller one, the virtual view last.
    signs: Vec<f64>,
    /// Of each photograph; empty if the order of depth is undecided.
    fronts: Vec<Front>,
}

impl<'a> Painter<'a> {
    fn new(images: &'a [&'a Image], surface: &'a Surface, shown: &[Surface], scene: &Reconstruction) -> Self {
        let signs: Vec<f64> =
            scene.cameras.iter().map(|camera| chirality::order_sign(camera, scene.hand)).collect();
        let hides = scene.geometry.order_by != OrderBy::Nothing;
        let front = |i: usize| Front::of(&shown[i], i, images[i].size(), signs[i]);
        let fronts = if hides { (0..images.len()).into_par_iter().map(front).collect() } else { vec![] };
        Self { images, surface, signs, fronts }
    }

    fn places(&self, corner: &[usize; 3]) -> [Point; 3] {
        corner.map(|k| self.surface.places[self.images.len()][k])
    }

    /// The plane of a triangle, and those of the triangles beside it; none for corners on a line.
    fn planes(&self, triangle: usize, sides: &BTreeMap<Edge, Vec<usize>>) -> Vec<Plane> {
        let triangles = &self.surface.mesh.triangles;
        let plane = |t: usize| {
            let corner = triangles[t];
            Some(Plane { corner, facet: Facet::new(&self.places(&corner))? })
        };
        let beside = edges(&triangles[triangle]).into_iter().flat_map(|edge| &sides[&edge]);
        let beside = beside.filter(|t| **t != triangle).filter_map(|t| plane(*t));
        let Some(own) = plane(triangle) else { return vec![] };
        std::iter::once(own).chain(beside).collect()
    }

    /// The shares and the place in a photograph of the point of a plane that falls on a position.
    fn shown(&self, plane: &Plane, position: &Point, image: usize) -> (Shares, Point) {
        let shares = plane.facet.shares(position);
        let there = self.surface.carried(shares, &plane.corner, self.images.len(), image);
        (there, self.surface.place_at(image, &plane.corner, there))
    }

    /// The plane on which the two photographs agree.
    fn plane_at<'p, const C: usize>(&self, planes: &'p [Plane], position: &Point) -> &'p Plane {
        let (own, beside) = (&planes[0], &planes[1..]);
        let at = |plane: &Plane, position: &Point| {
            let colour = |i: usize| colour_at::<C>(self.images[i], &self.shown(plane, position, i).1);
            let [a, b] = [0, 1].map(colour);
            Some(a?.iter().zip(b?).map(|(a, b)| (a - b).abs()).sum::<f32>() / C as f32)
        };
        let difference = |plane: &Plane| {
            let all = AROUND.map(|[x, y]| at(plane, &(position + Point::new(x, y))));
            Some(all.into_iter().sum::<Option<f32>>()? / AROUND.len() as f32)
        };
        let Some(now) = difference(own).filter(|now| *now > CONTRADICTION) else { return own };
        let others = beside.iter().filter_map(|plane| Some((difference(plane)?, plane)));
        let best = others.min_by(|a, b| a.0.total_cmp(&b.0));
        best.filter(|(least, _)| TIMES_BETTER * least + CONTRADICTION < now).map_or(own, |(_, plane)| plane)
    }

    fn blend<const C: usize>(&self, plane: &Plane, position: &Point) -> Blend<C> {
        let mut blend = Blend { sum: [0.0; C], weight: 0.0, shown: 0, visible: 0 };
        for (i, image) in self.images.iter().enumerate() {
            let (shares, place) = self.shown(plane, position, i);
            let Some(colour) = colour_at(image, &place) else { continue };
            let depth = self.signs[i] * self.surface.chi_at(i, &plane.corner, shares);
            let is_hidden = self.fronts.get(i).is_some_and(|front| front.hides(&place, depth));
            blend.add(colour, is_hidden);
        }
        blend
    }

    fn depth(&self, plane: &Plane, position: &Point) -> f64 {
        let target = self.images.len();
        self.signs[target] * self.surface.chi_at(target, &plane.corner, plane.facet.shares(position))
    }
}

struct Blend<const C: usize> {
    sum: [f32; C],
    weight: f32,
    /// Photographs that show the place of the point, and those in which nothing hides it.
    shown: u16,
    visible: u16,
}

impl<const C: usize> Blend<C> {
    fn add(&mut self, colour: [f32; C], is_hidden: bool) {
        let weight = if is_hidden { HIDDEN_WEIGHT } else { 1.0 };
        self.sum.iter_mut().zip(colour).for_each(|(sum, value)| *sum += weight * value);
        self.weight += weight;
        self.shown += 1;
        self.visible += u16::from(!is_hidden);
    }

    /// Black if no photograph shows the point.
    fn mean(&self) -> [f32; C] {
        self.sum.map(|sum| if self.shown > 0 { sum / self.weight } else { 0.0 })
    }
}

struct Front {
    width: usize,
    depth: Vec<f32>,
    /// The difference from which on a point is hidden.
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
