//! Propagation from general cameras.

mod projected;
mod row_map;

pub use projected::Projected;

use super::{CalibratedView, Frame};
use crate::camera::{Camera, Relative};
use crate::depth::TILE;
use crate::occlusion::{DepthTest, LARGEST_SPACING};
use crate::sample::Dropped;
use rayon::prelude::*;
use row_map::RowMap;

/// Factor of the radius of the depth test: its distances round.
const REACH: f64 = 1.01;

/// Where the pixels of all views fall in the virtual image, tile by tile, so that the samples of any band of
/// rows are found without looking at the pixels that miss it.
///
/// For one row of a view v = (d q2(x) + b2) / (d q3(x) + b3), with q affine in the column x. In front of the
/// virtual camera v is monotone in x and in d, so its extremes over a tile lie at the four corners of the
/// ranges of x and d: four projections for 64 pixels.
#[derive(Debug, Clone)]
pub(crate) struct Footprint {
    maps: Vec<Relative>,
    frame: Frame,
    tiles: Vec<Tile>,
    pub(crate) pixels: usize,
    unknown: usize,
    behind: usize,
}

/// Some neighbouring pixels of a view, at least one of which may be a sample.
#[derive(Debug, Clone, Copy)]
struct Tile {
    view: u16,
    row: u32,
    column: u32,
    rows: (f64, f64),
    spacing: f32,
}

impl Footprint {
    /// Looks at the tiles of the `chosen` views, by number, in parallel over the rows.
    pub(crate) fn of(views: &[CalibratedView<'_>], chosen: &[usize], camera: &Camera, frame: &Frame) -> Self {
        let maps: Vec<Relative> = views.iter().map(|v| v.camera.relative_to(camera)).collect();
        let rows: Vec<(usize, usize)> =
            chosen.iter().flat_map(|&i| (0..views[i].image.height()).map(move |y| (i, y))).collect();
        let rows_of_tiles: Vec<RowFootprint> = rows
            .par_iter()
            .map(|&(i, y)| RowFootprint::new(&views[i], i as u16, &maps[i], y, frame))
            .collect();
        let pixels = rows.iter().map(|&(i, _)| views[i].image.width()).sum();
        let tiles = Vec::with_capacity(rows_of_tiles.iter().map(|row| row.tiles.len()).sum());
        let mut footprint = Self { maps, frame: *frame, tiles, pixels, unknown: 0, behind: 0 };
        for row in rows_of_tiles {
            footprint.tiles.extend(row.tiles);
            footprint.unknown += row.unknown;
            footprint.behind += row.behind;
        }
        footprint
    }

    /// Samples in the frame, at most.
    pub(crate) fn most_samples(&self) -> usize {
        self.tiles.len() * TILE
    }

    /// Pixels outside the frame or without depth, if this many are samples.
    pub(crate) fn dropped(&self, samples: usize) -> Dropped {
        let (unknown, behind) = (self.unknown, self.behind);
        Dropped { unknown, behind, outside: self.pixels.saturating_sub(unknown + behind + samples) }
    }

    /// The samples between two rows of the frame, the second excluded, and those that may hide them.
    pub(crate) fn project_between(
        &self,
        views: &[CalibratedView<'_>],
        own: (f64, f64),
        test: &DepthTest,
    ) -> Projected {
        let (mut projected, reach) = (Projected::default(), REACH * test.radius(LARGEST_SPACING));
        let band = self.frame.band(own.0 - reach, own.1 + reach);
        for tile in self.reaching(own, |spacing| REACH * test.radius(spacing)) {
            let view = usize::from(tile.view);
            projected.push(&views[view], &self.maps[view], tile, &band, own, test);
        }
        projected
    }

    /// The tiles that may have samples between two rows, or as far from these as `reach` says of their
    /// spacing.
    fn reaching<'a>(
        &'a self,
        (top, bottom): (f64, f64),
        reach: impl Fn(f32) -> f64 + 'a,
    ) -> impl Iterator<Item = &'a Tile> {
        self.tiles.iter().filter(move |t| {
            let reach = reach(t.spacing);
            t.rows.0 - reach <= bottom && t.rows.1 + reach >= top
        })
    }
}

/// The tiles of one row of a view, and its pixels that cannot be samples.
struct RowFootprint {
    tiles: Vec<Tile>,
    unknown: usize,
    behind: usize,
}

impl RowFootprint {
    fn new(view: &CalibratedView<'_>, index: u16, map: &Relative, y: usize, frame: &Frame) -> Self {
        let tiles = Vec::with_capacity(view.image.width().div_ceil(TILE));
        let (mut footprint, row) = (Self { tiles, unknown: 0, behind: 0 }, RowMap::new(map, y));
        for (k, depths) in view.map.row(y).chunks(TILE).enumerate() {
            let column = k * TILE;
            let unknown = depths.iter().filter(|d| d.is_nan()).count();
            footprint.unknown += unknown;
            if unknown == depths.len() {
                continue;
            }
            let reach = row.corners(column, depths).unwrap_or_else(|| {
                let (reach, behind) = row.each(column, depths, frame);
                footprint.behind += behind;
                reach
            });
            if reach.meets(frame) {
                let (row, column) = (y as u32, column as u32);
                // Slopes are known as shares of depths, not of disparities with an offset.
                let known = view.map.offset() == 0.0;
                let spacing = if known { reach.spacing.min(LARGEST_SPACING) } else { LARGEST_SPACING };
                footprint.tiles.push(Tile { view: index, row, column, rows: reach.rows, spacing });
            }
        }
        footprint
    }
}

#[cfg(test)]
pub(crate) mod tests;
