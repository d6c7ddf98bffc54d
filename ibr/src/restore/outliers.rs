//! Values of a map that contradict those around them, where the other views do not outvote these.
//!
//! A single wrong value disagrees with its neighbours, and one that is mixed of two surfaces lies between
//! them. One in a cluster agrees with some of them, and disagrees with what lies farther away, as a value on
//! a thin thing does. It is rejected if no other view confirms it and one confirms what lies around it.

use crate::depth::{DepthMap, Measure, Origin};
use crate::image::Image;
use crate::pipeline::{Agreement, GREY_LEVELS};
use crate::propagate::{View, Viewpoint};
use crate::surfaces::DepthTest;
use rayon::prelude::*;

/// Differences of two values with errors are below this many of their standard deviations.
const DEVIATIONS: f32 = 3.0;

/// Neighbours, of eight, that a value on a surface has at least: those along a line one pixel wide.
const SUPPORTERS: usize = 2;

/// Neighbours, of eight on a ring, that a value has beyond a cluster of outliers at least: a corner has
/// three.
const RING_SUPPORTERS: usize = 3;

/// Largest distance in pixels to the sides of an edge: maps that were reduced or filtered mix the depths of
/// pixels that near.
const MIXED: isize = 2;

/// Pixels over which a slanted surface goes on in a line, and what it may miss of it, as a share of its
/// step.
const SLOPE: isize = 4;
const STRAIGHT: f32 = 0.5;

/// Radius of the ring in pixels: a cluster may be as large.
const RING: usize = 8;

/// Other views that vote on a value, at most: evenly chosen ones of more.
const VOTERS: usize = 8;

/// Of unlike colours the median takes the least weight: where no other value is known they decide.
const LEAST_LIKENESS: f32 = 1e-6;

/// Radius of the medians.
const RADIUS: usize = 2;

/// What a view says of a point of another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Vote {
    /// It is there, on a surface.
    Surface,
    /// It is there, where a surface ends.
    Outline,
    Nothing,
    /// What is seen there lies behind it.
    Through,
}

impl Vote {
    fn is_confirming(self) -> bool {
        matches!(self, Self::Surface | Self::Outline)
    }

    fn count(self) -> i32 {
        i32::from(self.is_confirming()) - i32::from(self == Self::Through)
    }
}

#[derive(Debug, Clone)]
pub(super) struct Parallax {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Row by row, NaN where unknown; next to 0 where far away.
    pub(super) values: Vec<f32>,
    /// Added to a value, it is in proportion to the reciprocal depth.
    pub(super) offset: f32,
    pub(super) error: f32,
}

impl Parallax {
    /// Of a map whose errors, in its own measure, have this standard deviation. Those of depths are shares
    /// of the depth; what is taken as the deviation of the reciprocal depth is that in the middle of the
    /// scene.
    pub(super) fn of(map: &DepthMap, error: f64) -> Self {
        let measure = map.measure();
        let values = map.data().iter().map(|v| measure.parallax(*v)).collect();
        let unit = match measure {
            Measure::Disparity => 1.0,
            Measure::Depth => map.middle().map_or(0.0, |middle| 1.0 / f64::from(middle)),
        };
        let ((width, height), offset) = (map.size(), map.offset() as f32);
        Self { width, height, values, offset, error: (error * unit) as f32 }
    }

    /// The map with these values. Where nothing changed it has the bits that it had.
    pub(super) fn into_map(self, before: &DepthMap, replaced: Vec<bool>) -> DepthMap {
        let measure = before.measure();
        let value = |(now, was): (&f32, &f32)| match measure.parallax(*was).to_bits() == now.to_bits() {
            true => *was,
            false if now.is_nan() => f32::NAN,
            false => measure.of_parallax(*now),
        };
        let data = self.values.iter().zip(before.data()).map(value).collect();
        before.with_values(before.size(), data).with_origins(before, &replaced, Origin::Replaced)
    }

    #[inline]
    pub(super) fn agree(&self, a: f32, b: f32) -> bool {
        let parallax = f64::from(DEVIATIONS * std::f32::consts::SQRT_2 * self.error);
        DepthTest { parallax, ..DepthTest::default() }.joins(a, b, self.offset)
    }

    fn around(&self, pixel: usize, radius: usize) -> impl Iterator<Item = usize> + use<> {
        let (x, y, width) = (pixel % self.width, pixel / self.width, self.width);
        let columns = x.saturating_sub(radius)..(x + radius + 1).min(width);
        let rows = y.saturating_sub(radius)..(y + radius + 1).min(self.height);
        rows.flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }

    /// The pixels in eight directions at a distance from one.
    fn ring(&self, pixel: usize, distance: usize) -> impl Iterator<Item = usize> + use<> {
        let (x, y, width, height) = (pixel % self.width, pixel / self.width, self.width, self.height);
        let steps = move |at: usize, side: usize| {
            [at.checked_sub(distance), Some(at), Some(at + distance).filter(|at| *at < side)]
        };
        let columns = steps(x, width);
        let pixels = steps(y, height)
            .into_iter()
            .flatten()
            .flat_map(move |row| columns.into_iter().flatten().map(move |column| row * width + column));
        pixels.filter(move |q| *q != pixel)
    }

    /// Whether so many pixels at a distance lie on the surface of a pixel.
    fn is_supported(&self, pixel: usize, distance: usize, least: usize) -> bool {
        let here = self.values[pixel];
        self.ring(pixel, distance).filter(|q| self.agree(here, self.values[*q])).take(least).count() == least
    }

    /// Whether a pixel lies between the sides of an edge: on one side of it a surface is nearer, and on the
    /// opposite side one is farther.
    fn is_between(&self, pixel: usize) -> bool {
        let here = self.values[pixel];
        let side = |step: [isize; 2]| match self.beside(pixel, step) {
            Some(value) if !self.agree(here, value) => i32::from(value > here) - i32::from(value < here),
            _ => 0,
        };
        let parts = |[dx, dy]: [isize; 2]| {
            let parts_at = |k: isize| side([k * dx, k * dy]) * side([-k * dx, -k * dy]) < 0;
            (1..=MIXED).any(parts_at) && !self.is_slope(pixel, [dx, dy])
        };
        [[1, 0], [0, 1], [1, 1], [1, -1]].into_iter().any(parts)
    }

    /// Whether the surface of a pixel is slanted: on one side at least the values go on in a line.
    fn is_slope(&self, pixel: usize, [dx, dy]: [isize; 2]) -> bool {
        let at = |k: isize| self.beside(pixel, [k * dx, k * dy]);
        let (here, [Some(before), Some(after)]) = (self.values[pixel], [at(-1), at(1)]) else { return false };
        let step = (after - before) / 2.0;
        let is_in_line = |k: isize| {
            at(k).is_some_and(|value| (value - here - k as f32 * step).abs() <= STRAIGHT * step.abs())
        };
        (1..=SLOPE).all(is_in_line) || (-SLOPE..=-1).all(is_in_line)
    }

    /// The known value so many columns and rows from a pixel.
    fn beside(&self, pixel: usize, [dx, dy]: [isize; 2]) -> Option<f32> {
        let x = (pixel % self.width).checked_add_signed(dx).filter(|x| *x < self.width)?;
        let y = (pixel / self.width).checked_add_signed(dy).filter(|y| *y < self.height)?;
        Some(self.values[y * self.width + x]).filter(|value| !value.is_nan())
    }

    /// The known pixels around a position, none outside the image.
    fn pixels_at(&self, [u, v]: [f64; 2]) -> impl Iterator<Item = usize> {
        let inside = |at: f64, side: usize| at > -0.5 && at < side as f64 - 0.5;
        let (columns, rows) = match inside(u, self.width) && inside(v, self.height) {
            true => {
                let (x, y) = (u.max(0.0) as usize, v.max(0.0) as usize);
                (x..(x + 2).min(self.width), y..(y + 2).min(self.height))
            }
            false => (0..0, 0..0),
        };
        let pixels = rows.flat_map(move |y| columns.clone().map(move |x| y * self.width + x));
        pixels.filter(|q| !self.values[*q].is_nan())
    }

    /// Gives pixels the median of those around them that are not rejected, weighed by the likeness of their
    /// colours; what has none is unknown.
    pub(super) fn replace(&mut self, image: &Image, rejected: &[bool]) {
        let mut left: Vec<usize> = (0..rejected.len()).filter(|p| rejected[*p]).collect();
        left.iter().for_each(|p| self.values[*p] = f32::NAN);
        // From the rim of a cluster inwards.
        loop {
            let before = left.len();
            let found: Vec<f32> = left.par_iter().map(|p| self.median(image, *p)).collect();
            left.iter().zip(&found).for_each(|(p, value)| self.values[*p] = *value);
            left.retain(|p| self.values[*p].is_nan());
            if left.is_empty() || left.len() == before {
                return;
            }
        }
    }

    /// Gives the pixels around those that were rejected their medians: where a map mixes surfaces, it mixes
    /// them a little there too. Rows take that for stretched surfaces: of maps of poster1 and Cones that are
    /// blurred by 1.5 pixels the views had 32.8 and 28.4 dB, and have 33.1 and 28.8.
    pub(super) fn sharpen(&mut self, image: &Image, rejected: &[bool]) {
        let is_beside = |p: usize| self.around(p, RADIUS).any(|q| rejected[q]);
        let value = |p: usize| match !self.values[p].is_nan() && is_beside(p) {
            true => self.median(image, p),
            false => self.values[p],
        };
        self.values = (0..rejected.len()).into_par_iter().with_min_len(256).map(value).collect();
    }

    /// The median of the known values around a pixel, weighed by the likeness of colours.
    pub(super) fn median(&self, image: &Image, pixel: usize) -> f32 {
        self.median_of(image, pixel, self.around(pixel, RADIUS))
    }

    fn median_of(&self, image: &Image, pixel: usize, pixels: impl Iterator<Item = usize>) -> f32 {
        let near = pixels.filter(|q| !self.values[*q].is_nan());
        let likeness = |q: usize| {
            let difference = difference(image.pixel(pixel), image.pixel(q)) / GREY_LEVELS;
            (-difference * difference).exp().max(LEAST_LIKENESS)
        };
        let mut near: Vec<(f32, f32)> = near.map(|q| (self.values[q], likeness(q))).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut left = near.iter().map(|(_, weight)| weight).sum::<f32>() / 2.0;
        let middle = near.iter().find(|(_, weight)| {
            left -= weight;
            left <= 0.0
        });
        middle.map_or(f32::NAN, |(value, _)| *value)
    }
}

pub(super) fn difference(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / 3.0
}

/// Views with their maps in parallax, and how well they agree.
pub(super) struct Known<'a, P> {
    views: &'a [View<'a, P>],
    pub(super) planes: Vec<Parallax>,
    pub(super) agreement: Agreement,
    /// The views that vote on values of each.
    pub(super) voters: Vec<Vec<usize>>,
}

impl<'a, P: Viewpoint> Known<'a, P> {
    pub(super) fn of(views: &'a [View<'a, P>]) -> Self {
        let agreement = Agreement::of(views);
        let plane = |(i, view): (usize, &View<'_, P>)| Parallax::of(view.map, agreement.depth_error(i));
        let planes = views.iter().enumerate().map(plane).collect();
        Self { views, planes, voters: voters(&agreement.groups()), agreement }
    }

    /// Which values of a view are outliers: few neighbours agree with them, and not more of the other views
    /// confirm them than see through them; or they lie between the sides of an edge, and more of the other
    /// views see through them; or they lie in a cluster of outliers.
    pub(super) fn rejected(&self, index: usize) -> Vec<bool> {
        let (map, plane, votes) = (self.views[index].map, &self.planes[index], self.ballot(index));
        let is_outlier = |p: usize| {
            let value = map.data()[p];
            if value.is_nan() || map.is_guessed(p) {
                return false;
            }
            let balance = || votes(p, value).into_iter().map(Vote::count).sum::<i32>();
            match plane.is_supported(p, 1, SUPPORTERS) {
                false => balance() <= 0,
                // Steep surfaces have such values too, which no view sees through.
                true if plane.is_between(p) => balance() < 0,
                true => self.is_in_cluster(index, p, RING, &votes),
            }
        };
        (0..plane.values.len()).into_par_iter().with_min_len(1024).map(is_outlier).collect()
    }

    /// Whether few values on the ring around a pixel agree with its own, no other view confirms that, and
    /// one shows a surface there at the median of the ring.
    pub(super) fn is_in_cluster(
        &self,
        index: usize,
        pixel: usize,
        ring: usize,
        votes: impl Fn(usize, f32) -> Vec<Vote>,
    ) -> bool {
        let (View { image, map, .. }, plane) = (self.views[index], &self.planes[index]);
        if plane.is_supported(pixel, ring, RING_SUPPORTERS) {
            return false;
        }
        let around = plane.median_of(image, pixel, plane.ring(pixel, ring));
        !around.is_nan()
            && !plane.agree(around, plane.values[pixel])
            && !votes(pixel, map.data()[pixel]).into_iter().any(Vote::is_confirming)
            && votes(pixel, map.measure().of_parallax(around)).contains(&Vote::Surface)
    }

    /// The votes of the others on values at pixels of a view.
    pub(super) fn ballot(&self, index: usize) -> impl Fn(usize, f32) -> Vec<Vote> + Sync {
        let (view, voters) = (&self.views[index], &self.voters[index]);
        let (width, measure) = (view.map.width(), view.map.measure());
        let maps: Vec<_> =
            voters.iter().map(|other| view.camera.map_to(&self.views[*other].camera)).collect();
        move |p, value| {
            let votes = voters.iter().zip(&maps).map(|(other, map)| {
                let (u, v, depth) = map((p % width) as f64, (p / width) as f64, f64::from(value));
                let there = measure.parallax(depth as f32);
                vote(&self.planes[*other], [u, v], there, |q| self.are_alike([index, *other], [p, q]))
            });
            votes.collect()
        }
    }

    /// Whether pixels of two views have nearly one colour.
    pub(super) fn are_alike(&self, views: [usize; 2], pixels: [usize; 2]) -> bool {
        let [a, b] = [0, 1].map(|k| -> [f32; 3] {
            let (colour, gain) =
                (self.views[views[k]].image.pixel::<3>(pixels[k]), self.agreement.gains[views[k]]);
            std::array::from_fn(|c| colour[c] * gain[c] as f32)
        });
        difference(a, b) <= GREY_LEVELS
    }
}

/// The views that vote on values of each: those that agree with it, or all if none does; evenly chosen ones
/// of many. `groups` are those of the agreement.
pub(super) fn voters(groups: &[usize]) -> Vec<Vec<usize>> {
    let all: Vec<usize> = (0..groups.len()).collect();
    let mut members = vec![Vec::new(); groups.len()];
    groups.iter().enumerate().for_each(|(view, group)| members[*group].push(view));
    let of = |view: &usize| {
        let own = &members[groups[*view]];
        let from = if own.len() > 1 { own } else { &all };
        let (place, count) = (from.partition_point(|other| other < view), from.len() - 1);
        let chosen = (0..count).step_by(count.div_ceil(VOTERS).max(1));
        chosen.map(|k| from[k + usize::from(k >= place)]).collect()
    };
    all.iter().map(of).collect()
}

/// What a view says of a point at a position with a parallax: it confirms it by a pixel of a surface there
/// that has nearly its colour, or sees through it; nothing if something hides it, or it falls outside.
fn vote(plane: &Parallax, at: [f64; 2], there: f32, has_colour: impl Fn(usize) -> bool) -> Vote {
    let (mut is_inside, mut is_on_surface, mut is_alike, mut is_seen_through) = (false, true, false, true);
    for q in plane.pixels_at(at) {
        let agrees = plane.agree(there, plane.values[q]);
        is_inside = true;
        is_on_surface &= agrees;
        is_alike |= agrees && has_colour(q);
        is_seen_through &= !agrees && plane.values[q] < there;
    }
    match (is_alike, is_on_surface, is_inside && is_seen_through) {
        (true, true, _) => Vote::Surface,
        (true, false, _) => Vote::Outline,
        (false, _, true) => Vote::Through,
        _ => Vote::Nothing,
    }
}
