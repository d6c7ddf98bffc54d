//! Propagation from general cameras.

use super::{CalibratedView, Frame, spacing, weight};
use crate::camera::{Camera, Relative};
use crate::depth::TILE;
use crate::sample::{Dropped, Sample};
use rayon::prelude::*;

/// Least depth at the virtual camera for which the corners of a tile say where its pixels fall, as a share
/// of the largest one.
const IN_FRONT: f64 = 1e-6;

/// Where the pixels of all views fall in the virtual image, tile by tile, so that the samples of any band of
/// rows are found without looking at the pixels that miss it.
///
/// For one row of a view v = (d q2(x) + b2) / (d q3(x) + b3), with q affine in the column x. In front of the
/// virtual camera v is monotone in x and in d, so its extremes over a tile lie at the four corners of the
/// ranges of x and d: four projections for 64 pixels.
#[derive(Debug, Clone)]
pub struct Survey {
    maps: Vec<Relative>,
    frame: Frame,
    tiles: Vec<Tile>,
    pixels: usize,
    unknown: usize,
    behind: usize,
}

/// Some neighbouring pixels of a view, at least one of which may be a sample.
#[derive(Debug, Clone, Copy)]
struct Tile {
    view: u16,
    row: u32,
    column: u32,
    /// Bounds of the virtual rows of its samples.
    rows: (f64, f64),
}

impl Survey {
    /// Looks at the tiles of all views, in parallel over the rows.
    pub fn new(views: &[CalibratedView<'_>], camera: &Camera, frame: &Frame) -> Self {
        let all: Vec<usize> = (0..views.len()).collect();
        Self::of(views, &all, camera, frame)
    }

    /// As [`Survey::new`], for some of the views, by number.
    pub fn of(views: &[CalibratedView<'_>], chosen: &[usize], camera: &Camera, frame: &Frame) -> Self {
        let maps: Vec<Relative> = views.iter().map(|v| v.camera.relative_to(camera)).collect();
        let rows: Vec<(usize, usize)> =
            chosen.iter().flat_map(|&i| (0..views[i].image.height()).map(move |y| (i, y))).collect();
        let surveyed: Vec<RowSurvey> =
            rows.par_iter().map(|&(i, y)| RowSurvey::new(&views[i], i as u16, &maps[i], y, frame)).collect();
        let pixels = rows.iter().map(|&(i, _)| views[i].image.width()).sum();
        let mut survey = Self { maps, frame: *frame, tiles: Vec::new(), pixels, unknown: 0, behind: 0 };
        for row in surveyed {
            survey.tiles.extend(row.tiles);
            survey.unknown += row.unknown;
            survey.behind += row.behind;
        }
        survey
    }

    /// Samples in the frame, at most.
    pub fn most_samples(&self) -> usize {
        self.tiles.len() * TILE
    }

    /// Pixels outside the frame or without depth, if this many are samples.
    pub fn dropped(&self, samples: usize) -> Dropped {
        let (unknown, behind) = (self.unknown, self.behind);
        Dropped { unknown, behind, outside: self.pixels.saturating_sub(unknown + behind + samples) }
    }

    /// The samples between two rows of the frame, both included: view by view and row by row (eq. 2.2 and
    /// 2.3).
    pub fn samples_between<const C: usize>(
        &self,
        views: &[CalibratedView<'_>],
        top: f64,
        bottom: f64,
    ) -> Vec<Sample<C>> {
        let band = self.frame.band(top, bottom);
        let mut samples = Vec::with_capacity(self.reaching(&band).count() * TILE);
        for tile in self.reaching(&band) {
            let view = usize::from(tile.view);
            tile_samples(&views[view], &self.maps[view], tile, &band, &mut samples);
        }
        samples
    }

    /// The tiles that may have samples in a band.
    fn reaching<'a>(&'a self, band: &Frame) -> impl Iterator<Item = &'a Tile> + use<'a> {
        let (top, bottom) = band.rows;
        self.tiles.iter().filter(move |t| t.rows.0 <= bottom && t.rows.1 >= top)
    }
}

/// All samples of calibrated views, view by view and row by row (eq. 2.2 and 2.3).
pub fn calibrated<const C: usize>(
    views: &[CalibratedView<'_>],
    camera: &Camera,
    frame: &Frame,
) -> (Vec<Sample<C>>, Dropped) {
    let survey = Survey::new(views, camera, frame);
    let samples = survey.samples_between(views, f64::MIN, f64::MAX);
    let dropped = survey.dropped(samples.len());
    (samples, dropped)
}

/// The tiles of one row of a view, and its pixels that cannot be samples.
#[derive(Default)]
struct RowSurvey {
    tiles: Vec<Tile>,
    unknown: usize,
    behind: usize,
}

impl RowSurvey {
    fn new(view: &CalibratedView<'_>, index: u16, map: &Relative, y: usize, frame: &Frame) -> Self {
        let (mut survey, row) = (Self::default(), RowMap::new(map, y));
        for (k, depths) in view.depth.row(y).chunks(TILE).enumerate() {
            let column = k * TILE;
            let unknown = depths.iter().filter(|d| d.is_nan()).count();
            survey.unknown += unknown;
            if unknown == depths.len() {
                continue;
            }
            let reach = row.corners(column, depths).unwrap_or_else(|| {
                let (reach, behind) = row.each(column, depths, frame);
                survey.behind += behind;
                reach
            });
            if reach.meets(frame) {
                let (row, column) = (y as u32, column as u32);
                survey.tiles.push(Tile { view: index, row, column, rows: reach.rows });
            }
        }
        survey
    }
}

/// Bounds of the positions of some samples in the virtual image.
struct Reach {
    columns: (f64, f64),
    rows: (f64, f64),
}

impl Reach {
    fn meets(&self, frame: &Frame) -> bool {
        let right = frame.width as f64 - 1.0 + frame.margin;
        let (left, end) = (self.columns.0 + frame.offset, self.columns.1 + frame.offset);
        left <= right && end >= -frame.margin && self.rows.0 <= frame.rows.1 && self.rows.1 >= frame.rows.0
    }
}

/// The map of the pixels of one row: A x~ is affine in the column.
struct RowMap<'a> {
    map: &'a Relative,
    y: f64,
    start: [f64; 3],
    /// Change of A x~ for a step to the right, and for one down.
    step: [f64; 3],
    down: [f64; 3],
    shift: [f64; 3],
    linear: bool,
}

/// A pixel with depth at the virtual camera.
struct Landing {
    /// Position and depth.
    at: (f64, f64, f64),
    /// A x~.
    ray: [f64; 3],
    /// Position without lenses.
    ideal: [f64; 2],
    /// 1 / depth.
    inverse: f64,
}

impl<'a> RowMap<'a> {
    fn new(map: &'a Relative, y: usize) -> Self {
        let (a, b, y) = (&map.a, &map.b, y as f64);
        let start = std::array::from_fn(|k| a[(k, 1)] * y + a[(k, 2)]);
        let [step, down] = [0, 1].map(|column| std::array::from_fn(|k| a[(k, column)]));
        Self { map, y, start, step, down, shift: [b.x, b.y, b.z], linear: map.is_linear() }
    }

    #[inline]
    fn land(&self, x: f64, depth: f64) -> Landing {
        // Written out: closures over the three coordinates are calls in this innermost loop.
        let ray = [
            self.start[0] + self.step[0] * x,
            self.start[1] + self.step[1] * x,
            self.start[2] + self.step[2] * x,
        ];
        let p =
            [ray[0] * depth + self.shift[0], ray[1] * depth + self.shift[1], ray[2] * depth + self.shift[2]];
        let inverse = 1.0 / p[2];
        let ideal = [p[0] * inverse, p[1] * inverse];
        let at = if self.linear { (ideal[0], ideal[1], p[2]) } else { self.map.map(x, self.y, depth) };
        Landing { at, ray, ideal, inverse }
    }

    /// What one pixel of known depth becomes.
    #[inline]
    fn fate(&self, x: f64, depth: f32, frame: &Frame) -> Fate {
        let landing = self.land(x, f64::from(depth));
        let (u, v, d) = landing.at;
        let u = u + frame.offset;
        // NaN: outside the domain of the lens model.
        if d <= 0.0 || u.is_infinite() || v.is_infinite() {
            Fate::Behind
        } else if frame.holds_column(u) && frame.holds_row(v) {
            Fate::Sample(landing)
        } else {
            Fate::Outside
        }
    }

    /// The displacements of a landing, in virtual pixels, for a step of one pixel to the right and for one
    /// down, on a surface whose depth changes by `slopes` per pixel in these directions.
    ///
    /// With q = A x~ and p = d q + b, dp = d A e + q d' and d(p.x / p.z) = (dp.x - p.x / p.z dp.z) / p.z.
    /// Lenses are left out: they change distances between neighbours by a few per cent.
    #[inline]
    fn steps(&self, landing: &Landing, depth: f64, slopes: [f64; 2]) -> [[f64; 2]; 2] {
        [self.moved(landing, depth, self.step, slopes[0]), self.moved(landing, depth, self.down, slopes[1])]
    }

    /// The displacement for the change `a` of A x~ and a change of the depth by `slope`.
    #[inline]
    fn moved(&self, landing: &Landing, depth: f64, a: [f64; 3], slope: f64) -> [f64; 2] {
        let Landing { ray, ideal, inverse, .. } = landing;
        let away = a[2] * depth + ray[2] * slope;
        let across = a[0] * depth + ray[0] * slope - ideal[0] * away;
        let along = a[1] * depth + ray[1] * slope - ideal[1] * away;
        [across * inverse, along * inverse]
    }

    /// Bounds of the samples of a tile, if all of it lies in front of the virtual camera and no lens bends
    /// the map.
    fn corners(&self, column: usize, depths: &[f32]) -> Option<Reach> {
        let (near, far) =
            depths.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), d| (a.min(*d), b.max(*d)));
        let ends = [column as f64, (column + depths.len() - 1) as f64];
        let corners = ends.map(|x| [near, far].map(|d| self.land(x, f64::from(d)).at));
        let all = || corners.iter().flatten();
        let bounds = |of: fn(&(f64, f64, f64)) -> f64| {
            all().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
        };
        let (least, largest) = bounds(|p| p.2);
        // The computed positions round: a millionth of a pixel is more than enough.
        let wide =
            |(low, high): (f64, f64)| (low - 1e-6 * (1.0 + low.abs()), high + 1e-6 * (1.0 + high.abs()));
        (self.linear && largest > 0.0 && least > IN_FRONT * largest)
            .then(|| Reach { columns: wide(bounds(|p| p.0)), rows: wide(bounds(|p| p.1)) })
    }

    /// The same from every pixel, and the number of pixels behind the virtual camera.
    fn each(&self, column: usize, depths: &[f32], frame: &Frame) -> (Reach, usize) {
        let mut behind = 0;
        let mut rows = (f64::INFINITY, f64::NEG_INFINITY);
        for (x, depth) in depths.iter().enumerate().filter(|(_, d)| !d.is_nan()) {
            match self.fate((column + x) as f64, *depth, frame) {
                Fate::Sample(landing) => rows = (rows.0.min(landing.at.1), rows.1.max(landing.at.1)),
                Fate::Behind => behind += 1,
                Fate::Outside => {}
            }
        }
        (Reach { columns: (f64::MIN, f64::MAX), rows }, behind)
    }
}

/// The outcome for one pixel of known depth.
enum Fate {
    Sample(Landing),
    Behind,
    Outside,
}

/// Appends the samples of a tile that lie in the frame.
fn tile_samples<const C: usize>(
    view: &CalibratedView<'_>,
    map: &Relative,
    tile: &Tile,
    frame: &Frame,
    samples: &mut Vec<Sample<C>>,
) {
    let (y, start) = (tile.row as usize, tile.column as usize);
    let (row, width) = (RowMap::new(map, y), view.image.width());
    let reliefs = view.depth.reliefs(start, y);
    for (x, &depth) in view.depth.row(y).iter().enumerate().skip(start).take(TILE) {
        if depth.is_nan() {
            continue;
        }
        let Fate::Sample(landing) = row.fate(x as f64, depth, frame) else { continue };
        let relief = reliefs.at(x - start);
        let [a, b] = row.steps(&landing, f64::from(depth), [relief.across, relief.down]);
        let pixel = y * width + x;
        let doubtful = relief.behind_edge || view.depth.is_guessed(pixel);
        let distance = ((a[0] * a[0] + a[1] * a[1] + b[0] * b[0] + b[1] * b[1]) / 2.0).sqrt();
        samples.push(Sample {
            x: landing.at.0 + frame.offset,
            y: landing.at.1,
            depth: landing.at.2 as f32,
            value: view.image.pixel::<C>(pixel),
            spacing: spacing(distance, relief.outline),
            weight: weight((a[0] * b[1] - a[1] * b[0]).abs(), doubtful),
            pixel: pixel as u32,
            view: tile.view,
            doubtful,
        });
    }
}

#[cfg(test)]
mod tests;
