//! The samples of a band of rows, as arrays.

use super::row_map::RowMap;
use super::{CalibratedView, Frame, Tile};
use crate::camera::Relative;
use crate::depth::{Origin, Reliefs, TILE, or_far};
use crate::occlusion::{DepthTest, Points, RUN};
use crate::propagate::{DOUBTFUL_WEIGHT, GUESSED_WEIGHT, spacing, weight};
use crate::sample::Sample;
use std::ops::Range;

/// The pixels of some tiles at their places in the virtual image, view by view and row by row.
#[derive(Debug, Clone, Default)]
pub struct Projected {
    points: Points,
    weights: Vec<f32>,
    doubtful: Vec<bool>,
    origins: Vec<Origin>,
    /// Shares of the views in the places of the pixels.
    shares: Vec<f32>,
    tiles: Vec<ProjectedTile>,
}

/// Share of a view below which its samples hide nothing: outlines that oblique views show tear holes into
/// what near ones show.
const LEAST_SHARE: f32 = 0.02;

#[derive(Debug, Clone, Copy)]
struct ProjectedTile {
    view: u16,
    first_pixel: u32,
    first_place: usize,
}

impl Projected {
    /// Appends the pixels of a tile; those between the rows `own` are the band's own.
    pub(super) fn push(
        &mut self,
        view: &CalibratedView<'_>,
        map: &Relative,
        tile: &Tile,
        frame: &Frame,
        own: (f64, f64),
        test: &DepthTest,
    ) {
        let (row, column) = (tile.row as usize, tile.column as usize);
        let first_pixel = row * view.image.width() + column;
        let known = &view.map.row(row)[column..];
        let known = &known[..known.len().min(TILE)];
        let mut depths = [f32::NAN; TILE];
        depths[..known.len()].copy_from_slice(known);
        let count = known.len().next_multiple_of(RUN);
        let reliefs = view.map.reliefs(column, row, test);
        let mut places = Places::new(&RowMap::new(map, row), column, &depths, &reliefs, count);
        places.keep(frame, own, count);
        let (mut doubtful, mut origins) = (reliefs.behind_edge, [Origin::Known; TILE]);
        for i in 0..count.min(TILE) {
            origins[i] = view.map.origin(first_pixel + i);
            doubtful[i] |= origins[i].is_guess();
        }
        let spacings: [f32; TILE] = std::array::from_fn(|i| spacing(places.distance[i], reliefs.outline[i]));
        let trust = |i: usize| match (origins[i].is_guess(), doubtful[i]) {
            (true, _) => GUESSED_WEIGHT,
            (_, true) => DOUBTFUL_WEIGHT,
            _ => 1.0,
        };
        let weights: [f32; TILE] = std::array::from_fn(|i| weight(places.area[i], trust(i)));
        let (points, first_pixel) = (&mut self.points, first_pixel as u32);
        self.tiles.push(ProjectedTile { view: tile.view, first_pixel, first_place: points.len() });
        points.x.extend_from_slice(&places.x[..count]);
        points.y.extend_from_slice(&places.y[..count]);
        points.depth.extend(places.depth[..count].iter().map(|d| *d as f32));
        points.own.extend_from_slice(&places.own[..count]);
        points.spacing.extend_from_slice(&spacings[..count]);
        self.weights.extend_from_slice(&weights[..count]);
        self.doubtful.extend_from_slice(&doubtful[..count]);
        points.hides.extend(origins[..count].iter().map(|origin| *origin != Origin::Filled));
        self.origins.extend_from_slice(&origins[..count]);
        self.shares.resize(points.len(), 1.0);
    }

    pub(crate) fn points(&self) -> &Points {
        &self.points
    }

    pub(crate) fn count(&self) -> usize {
        self.points.own.iter().filter(|own| **own).count()
    }

    pub(crate) fn remove(&mut self, places: &[u32]) {
        places.iter().for_each(|i| self.points.own[*i as usize] = false);
    }

    /// Gives each pixel the share of its view in its place, by `share` for the places of a tile; what has
    /// hardly any hides nothing.
    pub(crate) fn share(&mut self, share: impl Fn(u16, &Points, Range<usize>, &mut [f32])) {
        let Self { points, tiles, shares, .. } = self;
        let ends = tiles.iter().skip(1).map(|next| next.first_place).chain([points.len()]);
        for (tile, end) in tiles.iter().zip(ends) {
            let places = tile.first_place..end;
            share(tile.view, points, places.clone(), &mut shares[places.clone()]);
            places.for_each(|i| points.hides[i] &= shares[i] > LEAST_SHARE);
        }
    }

    /// The shares of the [`samples`](Self::samples).
    pub(crate) fn shares(&self) -> Vec<f32> {
        self.shares.iter().zip(&self.points.own).filter(|(_, own)| **own).map(|(share, _)| *share).collect()
    }

    pub(crate) fn samples<const C: usize>(&self, views: &[CalibratedView<'_>]) -> Vec<Sample<C>> {
        let Self { points, weights, doubtful, tiles, origins, .. } = self;
        let mut samples = Vec::with_capacity(self.count());
        let ends = tiles.iter().skip(1).map(|next| next.first_place).chain([points.len()]);
        for (tile, end) in tiles.iter().zip(ends) {
            let image = views[usize::from(tile.view)].image;
            let sample = |i: usize| {
                let pixel = tile.first_pixel + (i - tile.first_place) as u32;
                Sample {
                    x: points.x[i],
                    y: points.y[i],
                    depth: points.depth[i],
                    value: image.pixel::<C>(pixel as usize),
                    spacing: points.spacing[i],
                    weight: weights[i],
                    pixel,
                    view: tile.view,
                    doubtful: doubtful[i],
                    origin: origins[i],
                }
            };
            samples.extend((tile.first_place..end).filter(|i| points.own[*i]).map(sample));
        }
        samples
    }
}

/// The pixels of a tile in the virtual image: arrays of a fixed length, whose loops the compiler turns into
/// vector instructions. What belongs to unknown pixels is not a number.
struct Places {
    x: [f64; TILE],
    y: [f64; TILE],
    depth: [f64; TILE],
    /// Distance of neighbouring pixels, root mean square over the two directions.
    distance: [f64; TILE],
    area: [f64; TILE],
    own: [bool; TILE],
}

impl Places {
    // Indices, because these loops become vector instructions over all arrays.
    #[allow(clippy::needless_range_loop)]
    fn new(row: &RowMap<'_>, column: usize, depths: &[f32; TILE], reliefs: &Reliefs, count: usize) -> Self {
        let [x, y, depth, distance, area] = [[f64::NAN; TILE]; 5];
        let mut places = Self { x, y, depth, distance, area, own: [false; TILE] };
        // Of 32 bits, which the compiler converts several at a time.
        let at = |i: usize| f64::from(column as i32 + i as i32);
        for i in 0..count.min(TILE) {
            let depth = f64::from(depths[i]);
            let projection = row.project(at(i), depth);
            let slopes = [f64::from(reliefs.across[i]), f64::from(reliefs.down[i])];
            let [a, b] = row.steps(&projection, depth, slopes);
            (places.x[i], places.y[i], places.depth[i]) = projection.at;
            places.distance[i] = ((a[0] * a[0] + a[1] * a[1] + b[0] * b[0] + b[1] * b[1]) / 2.0).sqrt();
            places.area[i] = (a[0] * b[1] - a[1] * b[0]).abs();
        }
        if !row.linear {
            for i in 0..count.min(TILE) {
                (places.x[i], places.y[i], places.depth[i]) = row.bend(at(i), depths[i]);
            }
        }
        places
    }

    /// Marks what lies between the rows `own`, and removes what lies outside the frame.
    fn keep(&mut self, frame: &Frame, own: (f64, f64), count: usize) {
        for i in 0..count.min(TILE) {
            let (x, y, depth) = (self.x[i] + frame.offset, self.y[i], or_far(self.depth[i]));
            let kept = (depth > 0.0) & frame.holds(x, y);
            self.x[i] = if kept { x } else { f64::NAN };
            self.y[i] = if kept { y } else { f64::NAN };
            self.depth[i] = if kept { depth } else { f64::NAN };
            self.own[i] = kept & (y >= own.0) & (y < own.1);
        }
    }
}
