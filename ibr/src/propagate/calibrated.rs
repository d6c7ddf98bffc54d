//! Propagation from general cameras.

use super::{CalibratedView, Frame, spacing, weight};
use crate::camera::{Camera, Relative};
use crate::sample::{Dropped, Sample};
use rayon::prelude::*;

/// Pixels of a tile: part of one row of a view.
const TILE: usize = 64;

/// Where the pixels of all views fall in the virtual image: one propagation of every pixel, after which the
/// samples of any band of rows are found without looking at the pixels that miss it.
#[derive(Debug, Clone)]
pub struct Survey {
    maps: Vec<Relative>,
    frame: Frame,
    tiles: Vec<Tile>,
    /// Samples in the frame.
    pub samples: usize,
    /// Pixels outside the frame or without depth.
    pub dropped: Dropped,
}

/// Some neighbouring pixels of a view, at least one of which is a sample.
#[derive(Debug, Clone, Copy)]
struct Tile {
    view: u16,
    row: u32,
    column: u32,
    /// First and last virtual row of its samples.
    rows: (f64, f64),
}

impl Survey {
    /// Propagates every pixel once, in parallel over the rows, and keeps the rows that each tile reaches.
    pub fn new(views: &[CalibratedView<'_>], camera: &Camera, frame: &Frame) -> Self {
        let all: Vec<usize> = (0..views.len()).collect();
        Self::of(views, &all, camera, frame)
    }

    /// As [`Survey::new`], for some of the views, by number.
    pub fn of(views: &[CalibratedView<'_>], chosen: &[usize], camera: &Camera, frame: &Frame) -> Self {
        let maps: Vec<Relative> = views.iter().map(|v| v.camera.relative_to(camera)).collect();
        let rows: Vec<(usize, usize)> =
            chosen.iter().flat_map(|&i| (0..views[i].image.height()).map(move |y| (i, y))).collect();
        let surveyed: Vec<(Vec<Tile>, usize, Dropped)> =
            rows.par_iter().map(|&(i, y)| survey_row(&views[i], i as u16, &maps[i], y, frame)).collect();
        let mut survey =
            Self { maps, frame: *frame, tiles: Vec::new(), samples: 0, dropped: Dropped::default() };
        for (tiles, samples, dropped) in surveyed {
            survey.tiles.extend(tiles);
            survey.samples += samples;
            survey.dropped += dropped;
        }
        survey
    }

    /// The samples between two rows of the frame, both included: view by view and row by row (eq. 2.2 and
    /// 2.3). In parallel; the order does not depend on the number of threads.
    pub fn samples_between<const C: usize>(
        &self,
        views: &[CalibratedView<'_>],
        top: f64,
        bottom: f64,
    ) -> Vec<Sample<C>> {
        let band = self.frame.band(top, bottom);
        self.reaching(&band)
            .flat_map_iter(|tile| {
                let view = usize::from(tile.view);
                tile_samples(&views[view], &self.maps[view], tile, &band)
            })
            .collect()
    }

    /// The tiles that may have samples in a band.
    fn reaching<'a>(&'a self, band: &Frame) -> impl ParallelIterator<Item = &'a Tile> + use<'a> {
        let (top, bottom) = band.rows;
        self.tiles.par_iter().with_min_len(64).filter(move |t| t.rows.0 <= bottom && t.rows.1 >= top)
    }
}

/// All samples of calibrated views, view by view and row by row (eq. 2.2 and 2.3).
pub fn calibrated<const C: usize>(
    views: &[CalibratedView<'_>],
    camera: &Camera,
    frame: &Frame,
) -> (Vec<Sample<C>>, Dropped) {
    let survey = Survey::new(views, camera, frame);
    (survey.samples_between(views, f64::MIN, f64::MAX), survey.dropped)
}

/// The outcome for one pixel.
enum Fate {
    Sample(f64, f64, f64),
    Unknown,
    Behind,
    Outside,
}

/// Propagates one pixel of a calibrated view.
#[inline]
fn fate(map: &Relative, x: f64, y: f64, depth: f32, frame: &Frame) -> Fate {
    if depth.is_nan() {
        return Fate::Unknown;
    }
    let (u, v, d) = map.map(x, y, f64::from(depth));
    let u = u + frame.offset;
    // NaN: outside the domain of the lens model, or 0 * d of an infinite depth.
    if d <= 0.0 || u.is_infinite() || v.is_infinite() {
        Fate::Behind
    } else if frame.holds_column(u) && frame.holds_row(v) {
        Fate::Sample(u, v, d)
    } else {
        Fate::Outside
    }
}

/// Tiles, samples and dropped pixels of one row of a view.
fn survey_row(
    view: &CalibratedView<'_>,
    index: u16,
    map: &Relative,
    y: usize,
    frame: &Frame,
) -> (Vec<Tile>, usize, Dropped) {
    let (mut tiles, mut samples, mut dropped) = (Vec::new(), 0, Dropped::default());
    for (k, depths) in view.depth.row(y).chunks(TILE).enumerate() {
        let column = k * TILE;
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        for (x, &depth) in depths.iter().enumerate() {
            match fate(map, (column + x) as f64, y as f64, depth, frame) {
                Fate::Sample(_, v, _) => {
                    samples += 1;
                    (first, last) = (first.min(v), last.max(v));
                }
                Fate::Unknown => dropped.unknown += 1,
                Fate::Behind => dropped.behind += 1,
                Fate::Outside => dropped.outside += 1,
            }
        }
        if first <= last {
            tiles.push(Tile { view: index, row: y as u32, column: column as u32, rows: (first, last) });
        }
    }
    (tiles, samples, dropped)
}

/// The samples of a tile that lie in the frame.
fn tile_samples<const C: usize>(
    view: &CalibratedView<'_>,
    map: &Relative,
    tile: &Tile,
    frame: &Frame,
) -> impl Iterator<Item = Sample<C>> {
    let (y, start) = (tile.row as usize, tile.column as usize);
    let (index, frame, map) = (tile.view, *frame, *map);
    let width = view.image.width();
    (start..(start + TILE).min(width)).filter_map(move |x| {
        let depth = view.depth.row(y)[x];
        let Fate::Sample(u, v, d) = fate(&map, x as f64, y as f64, depth, &frame) else { return None };
        let relief = view.depth.relief(x, y);
        let [a, b] = map.steps(x as f64, y as f64, f64::from(depth), [relief.across, relief.down]);
        let pixel = y * width + x;
        let doubtful = relief.behind_edge || view.depth.is_guessed(pixel);
        Some(Sample {
            x: u,
            y: v,
            depth: d as f32,
            value: view.image.pixel::<C>(pixel),
            spacing: spacing(((a.norm_squared() + b.norm_squared()) / 2.0).sqrt(), &relief),
            weight: weight((a.x * b.y - a.y * b.x).abs(), doubtful),
            pixel: pixel as u32,
            view: index,
            doubtful,
        })
    })
}

#[cfg(test)]
mod tests;
