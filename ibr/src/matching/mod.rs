//! Depth from photographs: semi-global matching (H. Hirschmueller, "Stereo processing by semiglobal
//! matching and mutual information", IEEE PAMI 30, 2008) along the rays of pixels.
//!
//! The hypotheses of a pixel are parallaxes (disparities of a rig, reciprocal depths) at equal distances,
//! each of which moves it by about a pixel in the nearest other photographs. A hypothesis costs what the
//! surroundings there differ (`census`). Paths from eight directions join pixels to surfaces (`aggregate`),
//! and what the other photographs do not confirm is unknown (`check`). The photographs are matched twice:
//! at a quarter of their size for the range of the parallaxes, and in it at their size.

mod aggregate;
mod census;
mod check;

use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::propagate::Viewpoint;
use census::Costs;
use hybank::memory::{MemoryShortage, check_memory};
use rayon::prelude::*;
use std::ops::Range;

/// A photograph and its camera.
#[derive(Debug, Clone, Copy)]
pub struct Photograph<'a, P> {
    /// The image.
    pub image: &'a Image,
    /// The position on the line of a rectified rig, or a matrix.
    pub camera: P,
}

/// Why photographs cannot be matched.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// There is no other photograph at another place.
    #[error("photograph {} has no other one at another place, with which it could be matched", .0 + 1)]
    Alone(usize),
    /// Hardly any point was found in two photographs.
    #[error(
        "photograph {} and those beside it show hardly any common point; are they rectified, and are the cameras right?",
        .0 + 1
    )]
    Unlike(usize),
    /// There is too little memory.
    #[error("to match the photographs takes {0}; shrink them")]
    Memory(MemoryShortage),
}

/// Other photographs that each one is matched with: the nearest.
const OTHERS: usize = 2;

/// Sides of the photographs by which the range is found, as a part of theirs.
const REDUCTION: usize = 4;

/// Largest displacement between two photographs, as a part of the width.
const WIDEST: f64 = 0.3;

/// Share of the parallaxes at either end that the range leaves out, and the steps that are added to it.
const STRAY: f64 = 0.005;
const MARGIN: f32 = 6.0;

/// Share of the pixels of a photograph that must be confirmed.
const LEAST_SHARE: f64 = 0.05;

/// Rows that are matched together, and rows beyond them from which paths begin.
const ROWS: usize = 96;
const LEAD: usize = 24;

/// Bytes per hypothesis of a pixel: a cost and a sum.
const BYTES: f64 = 3.0;

/// The work on one photograph.
struct Sweep<'a, P> {
    camera: &'a P,
    measure: Measure,
    grey: Image,
    /// Pixels of the photograph per pixel of `grey`.
    reduction: usize,
    /// The photographs in which points are looked for.
    others: Vec<usize>,
    /// Parallax per step.
    unit: f32,
    /// Numbers of the hypotheses.
    range: Range<i32>,
}

/// Dense maps from photographs of one kind, with what two photographs do not show unknown. Disparities are in
/// pixels for a baseline of one, depths in the unit of the cameras.
///
/// # Errors
/// [`MatchError`].
pub fn depths<P: Viewpoint>(
    photographs: &[Photograph<'_, P>],
    measure: Measure,
) -> Result<Vec<DepthMap>, MatchError> {
    let mut sweeps = sweeps(photographs, measure)?;
    sweeps.iter_mut().for_each(|sweep| sweep.reduce(REDUCTION));
    let coarse = matched(&sweeps)?;
    for (k, ((sweep, photograph), found)) in sweeps.iter_mut().zip(photographs).zip(&coarse).enumerate() {
        sweep.grey = photograph.image.to_grey();
        sweep.narrow(found).ok_or(MatchError::Unlike(k))?;
    }
    let fine = matched(&sweeps)?;
    let map = |(sweep, found): (&Sweep<'_, P>, Vec<f32>)| {
        let data = found.into_iter().map(|v| measure.of_parallax(v)).collect();
        DepthMap::from_known(sweep.grey.size(), data, measure)
    };
    let maps: Vec<DepthMap> = sweeps.iter().zip(fine).map(map).collect();
    let is_unlike = |map: &DepthMap| map.unknown() as f64 > (1.0 - LEAST_SHARE) * map.data().len() as f64;
    maps.iter().position(is_unlike).map_or(Ok(maps), |k| Err(MatchError::Unlike(k)))
}

/// The parallaxes of all photographs, NaN where they are not confirmed.
fn matched<P: Viewpoint>(sweeps: &[Sweep<'_, P>]) -> Result<Vec<Vec<f32>>, MatchError> {
    let cells = |sweep: &Sweep<'_, P>| (sweep.grey.width() * (ROWS + 2 * LEAD) * sweep.range.len()) as f64;
    let most = sweeps.iter().map(cells).fold(0.0, f64::max);
    check_memory(BYTES * most * rayon::current_num_threads() as f64).map_err(MatchError::Memory)?;
    let found: Vec<Vec<f32>> = sweeps.iter().map(|sweep| sweep.parallaxes(sweeps)).collect();
    Ok(check::confirmed(sweeps, &found))
}

fn sweeps<'a, P: Viewpoint>(
    photographs: &'a [Photograph<'_, P>],
    measure: Measure,
) -> Result<Vec<Sweep<'a, P>>, MatchError> {
    let one = |(k, photograph): (usize, &'a Photograph<'_, P>)| {
        let camera = &photograph.camera;
        let distance = |other: &usize| camera.distance(&photographs[*other].camera);
        let mut others: Vec<usize> = (0..photographs.len()).filter(|other| distance(other) > 0.0).collect();
        others.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        others.truncate(OTHERS);
        let mut sweep =
            Sweep { camera, measure, grey: photograph.image.to_grey(), reduction: 1, others, unit: 0.0, range: 0..0 };
        let shift = |other: &usize| sweep.shift_per_parallax(&photographs[*other].camera);
        let most = sweep.others.iter().map(shift).fold(0.0, f64::max);
        if !(most.is_finite() && most > 0.0) {
            return Err(MatchError::Alone(k));
        }
        sweep.unit = (1.0 / most) as f32;
        let widest = (WIDEST * sweep.grey.width() as f64) as i32;
        sweep.range = if measure == Measure::Disparity { -widest..widest + 1 } else { 0..widest + 1 };
        Ok(sweep)
    };
    photographs.iter().enumerate().map(one).collect()
}

impl<'a, P: Viewpoint> Sweep<'a, P> {
    /// Mean displacement in another photograph per parallax, for points that are far away.
    fn shift_per_parallax(&self, other: &P) -> f64 {
        let (width, height) = self.grey.size();
        let map = self.camera.map_to(other);
        let step = 1e-3 / self.camera.distance(other);
        let [far, near] = [0.0, step].map(|parallax| f64::from(self.measure.of_parallax(parallax as f32)));
        let places = [0.25, 0.5, 0.75].map(|share| [share * width as f64, share * height as f64]);
        let shift = |[x, y]: [f64; 2]| {
            let ((a, b, _), (c, d, _)) = (map(x, y, far), map(x, y, near));
            (c - a).hypot(d - b) / step
        };
        places.map(shift).iter().sum::<f64>() / places.len() as f64
    }

    /// A smaller photograph, with as many fewer hypotheses.
    fn reduce(&mut self, by: usize) {
        let (width, height) = self.grey.size();
        if width.min(height) < 8 * by {
            return;
        }
        let size = (width / by, height / by);
        let mean = |p: usize| {
            let (x, y) = (p % size.0 * by, p / size.0 * by);
            (0..by * by).map(|k| self.grey.row(y + k / by)[x + k % by]).sum::<f32>() / (by * by) as f32
        };
        self.grey = Image::from_values(size, 1, (0..size.0 * size.1).map(mean).collect());
        self.reduction = by;
        self.unit *= by as f32;
        self.range = self.range.start / by as i32..self.range.end / by as i32 + 1;
    }

    /// The range of the parallaxes that were found, at the size of the photograph; `None` if these are few.
    fn narrow(&mut self, found: &[f32]) -> Option<()> {
        let mut known: Vec<f32> = found.iter().copied().filter(|v| !v.is_nan()).collect();
        if (known.len() as f64) < LEAST_SHARE * found.len() as f64 {
            return None;
        }
        known.sort_by(f32::total_cmp);
        let stray = (STRAY * known.len() as f64) as usize;
        self.unit /= self.reduction as f32;
        let margin = MARGIN * self.reduction as f32 / 2.0;
        self.reduction = 1;
        let [low, high] = [known[stray], known[known.len() - 1 - stray]].map(|v| v / self.unit);
        let low = (low - margin).floor() as i32;
        let low = if self.measure == Measure::Depth { low.max(0) } else { low };
        self.range = low..(high + margin).ceil() as i32 + 1;
        Some(())
    }

    /// The map of positions and parallaxes to another photograph, both reduced.
    fn map_to(&self, other: &Self) -> impl Fn([f64; 2], f32) -> ([f64; 2], f32) + Sync {
        let (map, measure, by) = (self.camera.map_to(other.camera), self.measure, self.reduction as f64);
        let centre = (by - 1.0) / 2.0;
        move |[x, y], parallax| {
            let value = f64::from(measure.of_parallax(parallax));
            let (u, v, there) = map(by * x + centre, by * y + centre, value);
            let parallax = if there > 0.0 || measure == Measure::Disparity { measure.parallax(there as f32) } else { f32::NAN };
            ([(u - centre) / by, (v - centre) / by], parallax)
        }
    }

    /// The parallaxes of all pixels, in bands of rows at the same time.
    fn parallaxes(&self, sweeps: &[Self]) -> Vec<f32> {
        let height = self.grey.height();
        let bands: Vec<Range<usize>> = (0..height).step_by(ROWS).map(|y| y..(y + ROWS).min(height)).collect();
        let found: Vec<Vec<f32>> = bands.into_par_iter().map(|band| self.band(sweeps, band)).collect();
        found.concat()
    }

    fn band(&self, sweeps: &[Self], band: Range<usize>) -> Vec<f32> {
        let (width, height) = self.grey.size();
        let rows = band.start.saturating_sub(LEAD)..(band.end + LEAD).min(height);
        let mut costs = Costs::new(&self.grey, rows.clone(), self.range.len());
        for other in self.others.iter().map(|other| &sweeps[*other]) {
            let map = self.map_to(other);
            for (hypothesis, k) in self.range.clone().enumerate() {
                costs.offer(hypothesis, &other.grey, |x, y| map([x, y], k as f32 * self.unit).0);
            }
        }
        let costs = costs.finished();
        let sums = aggregate::aggregated(&costs, &self.grey.data()[rows.start * width..rows.end * width]);
        let skipped = (band.start - rows.start) * width;
        let best = aggregate::best(&sums, costs.hypotheses).skip(skipped).take(band.len() * width);
        best.map(|k| (k + self.range.start as f32) * self.unit).collect()
    }
}

#[cfg(test)]
mod tests;
