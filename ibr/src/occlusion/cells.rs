//! A coarse grid that tells which samples of the plane may be hidden, and which may hide them.
//!
//! Within a surface no depths of neighbours are far enough apart for one sample to hide another. So runs of
//! neighbouring samples are compared with the least depth around them, and only what lies near a depth edge
//! is left for the search.

use super::DepthTest;
use super::points::{Points, RUN};
use crate::lanes::{bounds, largest, least};
use std::ops::Range;

/// Edge of a cell in pixels. With 2.5, 4 and 6 the samples of the synthetic scene took 10.6, 10.5 and
/// 10.4 ms with two views, and 56, 68 and 80 ms with eight.
const EDGE: f64 = 2.5;

/// Columns of cells that a run usually meets, where samples lie a pixel apart.
const USUAL_COLUMNS: usize = 5;

/// Factor of the radius: the distance test rounds.
const ROUNDING: f64 = 1.0001;

#[derive(Debug, Clone, Copy)]
struct Run {
    /// Bounds of the cells within the largest radius of a sample of the run, inclusive.
    columns: [u32; 2],
    rows: [u32; 2],
    near: f32,
    /// Largest depth of the samples on which the test decides.
    far: f32,
}

impl Run {
    /// Places without a sample.
    const EMPTY: Self = Self { columns: [0; 2], rows: [0; 2], near: f32::INFINITY, far: f32::NEG_INFINITY };
}

/// Runs of samples, and the depths in the cells that they reach; work memory that is used again.
#[derive(Debug, Clone, Default)]
pub(super) struct Cells {
    left: f64,
    top: f64,
    /// Cells per pixel.
    scale: f64,
    columns: usize,
    rows: usize,
    runs: Vec<Run>,
    /// Least depth of all samples whose radius reaches into a cell.
    near: Vec<f32>,
    /// Largest depth of the suspects in a cell.
    far: Vec<f32>,
}

impl Cells {
    /// Places the grid over the samples, and enters them.
    pub(super) fn enter(&mut self, points: &Points, test: &DepthTest) {
        self.place(points);
        self.runs.clear();
        for start in (0..points.len()).step_by(RUN) {
            let run = self.run(points, start..start + RUN, test);
            self.runs.push(run);
            if run.near < f32::INFINITY {
                let mut cells = std::mem::take(&mut self.near);
                self.each_cell(&run, |cell| cells[cell] = least(cells[cell], run.near));
                self.near = cells;
            }
        }
    }

    fn place(&mut self, points: &Points) {
        let none = (f64::MAX, f64::MIN);
        let (left, right) = bounds::<_, 2>(&points.x, none);
        let (top, bottom) = bounds::<_, 2>(&points.y, none);
        let cells = |edge: f64| ((right - left) / edge + 1.0) * ((bottom - top) / edge + 1.0);
        let mut edge = EDGE;
        // Until there are few; this ends at the latest when one cell holds all samples. Positions may be
        // infinite.
        while cells(edge) > (points.len() + 16) as f64 && edge.is_finite() {
            edge *= 2.0;
        }
        (self.left, self.top, self.scale) = (left, top, 1.0 / edge);
        let side = |low: f64, high: f64| ((high - low) * self.scale) as usize + 1;
        (self.columns, self.rows) = (side(left, right), side(top, bottom));
        let cells = self.columns * self.rows;
        self.near.clear();
        self.near.resize(cells, f32::INFINITY);
        self.far.clear();
        self.far.resize(cells, f32::NEG_INFINITY);
    }

    fn run(&self, points: &Points, places: Range<usize>, test: &DepthTest) -> Run {
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        let across = bounds::<_, 2>(&points.x[places.clone()], none);
        let down = bounds::<_, 2>(&points.y[places.clone()], none);
        if across.0 > across.1 || down.0 > down.1 {
            return Run::EMPTY;
        }
        let none = (f32::INFINITY, f32::NEG_INFINITY);
        let depths: &[f32] = &points.depth[places.clone()];
        let (near, mut far) = bounds::<_, 4>(depths, none);
        let own = &points.own[places.clone()];
        if own != [true; RUN] {
            let own = depths.iter().zip(own).filter(|(_, own)| **own);
            far = own.fold(none.1, |far, (d, _)| largest(far, *d));
        }
        let spacing = bounds::<_, 4>(&points.spacing[places], (0.0, 0.0)).1;
        Run { near, far, ..self.around(across, down, test.radius(spacing)) }
    }

    /// The cells within a radius of a rectangle.
    #[inline]
    fn around(&self, across: (f64, f64), down: (f64, f64), radius: f64) -> Run {
        let reach = ROUNDING * radius;
        let cells = |(low, high): (f64, f64), origin: f64, count: usize| {
            let cell = |v: f64| (((v - origin) * self.scale) as u32).min(count as u32 - 1);
            [cell(low - reach), cell(high + reach)]
        };
        let columns = cells(across, self.left, self.columns);
        Run { columns, rows: cells(down, self.top, self.rows), ..Run::EMPTY }
    }

    pub(super) fn count(&self) -> usize {
        self.far.len()
    }

    #[inline]
    pub(super) fn cell(&self, points: &Points, i: usize) -> usize {
        let at = |v: f64, origin: f64| ((v - origin) * self.scale) as usize;
        at(points.y[i], self.top) * self.columns + at(points.x[i], self.left)
    }

    /// Calls `with` for each cell in which a sample may hide a suspect.
    pub(super) fn reached(&self, points: &Points, test: &DepthTest, i: usize, mut with: impl FnMut(usize)) {
        let (x, y, depth) = (points.x[i], points.y[i], f64::from(points.depth[i]));
        let Run { columns, rows, .. } = self.around((x, x), (y, y), test.radius(points.spacing[i]));
        for row in rows[0]..=rows[1] {
            let cells = (columns[0]..=columns[1]).map(|column| row as usize * self.columns + column as usize);
            cells.filter(|cell| test.hides(depth, f64::from(self.far[*cell]))).for_each(&mut with);
        }
    }

    /// Calls `with` for each cell of a run, for some of them repeatedly.
    #[inline(always)]
    fn each_cell(&self, run: &Run, mut with: impl FnMut(usize)) {
        let ([left, right], [top, bottom]) = (run.columns.map(|c| c as usize), run.rows.map(|r| r as usize));
        if right < left + USUAL_COLUMNS && bottom < top + 2 {
            // Always as many cells: the processor cannot foresee how often a loop would run.
            for row in [top * self.columns, bottom * self.columns] {
                (0..USUAL_COLUMNS).for_each(|k| with(row + (left + k).min(right)));
            }
        } else {
            for row in top..=bottom {
                (left..=right).for_each(|column| with(row * self.columns + column));
            }
        }
    }

    /// Finds the samples that may be hidden: those far enough behind the nearest one in their cell.
    pub(super) fn suspects(&mut self, points: &Points, test: &DepthTest, suspects: &mut Vec<u32>) {
        suspects.clear();
        let hides = |near: f32, far: f32| test.hides(f64::from(near), f64::from(far));
        for (k, run) in self.runs.iter().enumerate().filter(|(_, run)| run.far > f32::NEG_INFINITY) {
            let mut near = f32::INFINITY;
            self.each_cell(run, |cell| near = least(near, self.near[cell]));
            if !hides(near, run.far) {
                continue;
            }
            for i in (k * RUN..(k + 1) * RUN).filter(|i| points.own[*i]) {
                let cell = self.cell(points, i);
                if hides(self.near[cell], points.depth[i]) {
                    self.far[cell] = largest(self.far[cell], points.depth[i]);
                    suspects.push(i as u32);
                }
            }
        }
    }

    /// Calls `with` for each sample that may hide a suspect.
    pub(super) fn hiders(&self, points: &Points, test: &DepthTest, mut with: impl FnMut(usize)) {
        let hides = |near: f32, far: f32| test.hides(f64::from(near), f64::from(far));
        for (k, run) in self.runs.iter().enumerate() {
            let mut far = f32::NEG_INFINITY;
            self.each_cell(run, |cell| far = largest(far, self.far[cell]));
            if hides(run.near, far) {
                let may_hide = |i: &usize| points.hides[*i] && hides(points.depth[*i], far);
                (k * RUN..(k + 1) * RUN).filter(may_hide).for_each(&mut with);
            }
        }
    }
}
