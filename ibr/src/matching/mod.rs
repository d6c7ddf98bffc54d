//! Depth from photographs: semi-global matching (H. Hirschmüller, "Stereo processing by semiglobal matching
//! and mutual information", IEEE PAMI 30, 2008) along the rays of pixels.
//!
//! The hypotheses of a pixel are parallaxes (disparities of a rig, reciprocal depths) at equal distances,
//! each of which moves it by about a pixel in other photographs. A hypothesis costs what the surroundings
//! there differ (`census`), paths from eight directions join pixels to surfaces (`aggregate`), and what no
//! other photograph confirms is unknown. All is done twice: at a quarter of the size for the range of the
//! parallaxes, and then in it.

mod aggregate;
mod census;

use crate::depth::{DepthMap, Measure};
use crate::image::Image;
use crate::propagate::Viewpoint;
use census::Costs;
use rayon::prelude::*;
use std::ops::Range;

/// A photograph, and its position on the line of a rectified rig or its matrix.
#[derive(Debug, Clone, Copy)]
pub struct Photograph<'a, P> {
    /// The image.
    pub image: &'a Image,
    /// The camera.
    pub camera: P,
}

/// Why photographs cannot be matched; they are numbered from 0.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// There is no other photograph at another place.
    #[error("photograph {} has no other one at another place, with which it could be matched", .0 + 1)]
    Alone(usize),
    /// Hardly any point was found in two photographs.
    #[error("photograph {} and those beside it show hardly any common point; are they rectified, and are the cameras right?", .0 + 1)]
    Unlike(usize),
}

/// Other photographs with which each one is matched: the nearest.
const OTHERS: usize = 2;

/// Least distance of two photographs that are matched, as a share of the median distance.
const LEAST_BASELINE: f64 = 0.02;

/// The part of their sides that the photographs have when the range is looked for.
const REDUCTION: usize = 4;

/// Largest displacement between two photographs, as a share of the width: of a rig, and of general cameras,
/// which may turn towards the scene, so that it counts from the far away.
const WIDEST: f64 = 0.3;
const WIDEST_FROM_FAR: f64 = 0.6;

/// Share of the parallaxes at either end that the range leaves out, and pixels that it is longer there.
const STRAY: f64 = 0.005;
const MARGIN: f32 = 12.0;

/// Share of the pixels that others must confirm: in unlike photographs a fifth is by chance.
const LEAST_SHARE: f64 = 0.3;

/// Rows that are matched together, and rows beyond them where paths begin.
const ROWS: usize = 96;
const LEAD: usize = 24;

struct Sweep<P> {
    camera: P,
    measure: Measure,
    grey: Image,
    others: Vec<usize>,
    /// Parallax from one hypothesis to the next.
    unit: f32,
    range: Range<i32>,
}

/// Maps of the `wanted` ones of photographs of one kind, unknown where no other photograph shows the point:
/// disparities in pixels for a baseline of one, or depths in the unit of the cameras.
///
/// # Errors
/// [`MatchError`].
pub fn depths<P: Viewpoint>(
    photographs: &[Photograph<'_, P>],
    measure: Measure,
    wanted: &[bool],
) -> Result<Vec<Option<DepthMap>>, MatchError> {
    let sweeps = |by| {
        let reduced = |p: &Photograph<'_, P>| (p.camera.reduced(by), p.image.to_grey().reduced(by));
        let sweep =
            |(camera, grey)| Sweep { camera, measure, grey, others: Vec::new(), unit: 0.0, range: 0..0 };
        let mut sweeps: Vec<_> = photographs.iter().map(reduced).map(sweep).collect();
        (0..sweeps.len()).try_for_each(|k| Sweep::prepare(&mut sweeps, k)).map(|()| sweeps)
    };
    let coarse = sweeps(REDUCTION)?;
    let needed = with_others(&coarse, wanted);
    let found = matched(&coarse, &needed);
    check(&found, wanted)?;
    let mut fine = sweeps(1)?;
    fine.iter_mut().zip(&found).for_each(|(sweep, found)| sweep.narrow(found));
    let found = matched(&fine, wanted);
    check(&found, wanted)?;
    let map = |(sweep, found): (&Sweep<P>, Vec<f32>)| {
        let data: Vec<f32> = found.into_iter().map(|v| measure.of_parallax(v)).collect();
        (!data.is_empty()).then(|| DepthMap::from_known(sweep.grey.size(), data, measure))
    };
    Ok(fine.iter().zip(found).map(map).collect())
}

/// The wanted photographs, and those with which they are matched.
fn with_others<P>(sweeps: &[Sweep<P>], wanted: &[bool]) -> Vec<bool> {
    let is_other = |k: usize| sweeps.iter().zip(wanted).any(|(s, wanted)| *wanted && s.others.contains(&k));
    (0..sweeps.len()).map(|k| wanted[k] || is_other(k)).collect()
}

/// The parallaxes of the wanted photographs, NaN where no other one has the same at the point; those of the
/// rest are empty.
fn matched<P: Viewpoint>(sweeps: &[Sweep<P>], wanted: &[bool]) -> Vec<Vec<f32>> {
    let each = |asked: &[bool], of: &dyn Fn(usize) -> Vec<f32>| -> Vec<Vec<f32>> {
        (0..sweeps.len()).map(|k| if asked[k] { of(k) } else { Vec::new() }).collect()
    };
    let found = each(&with_others(sweeps, wanted), &|k| sweeps[k].parallaxes(sweeps));
    each(wanted, &|k| sweeps[k].confirmed(sweeps, &found, k))
}

/// Refuses wanted photographs of which others confirm too little.
fn check(found: &[Vec<f32>], wanted: &[bool]) -> Result<(), MatchError> {
    let is_unlike = |k: &usize| {
        let known = found[*k].iter().filter(|v| !v.is_nan()).count();
        wanted[*k] && known as f64 <= LEAST_SHARE * found[*k].len() as f64
    };
    (0..found.len()).find(is_unlike).map_or(Ok(()), |k| Err(MatchError::Unlike(k)))
}

/// The indices of the [`OTHERS`] smallest distances, and of fewer if there are fewer. Photographs from
/// nearly one place do not show depth, so a distance that is far below the usual one does not count.
fn nearest(distances: &[f64]) -> Vec<usize> {
    let mut sorted: Vec<f64> = distances.iter().copied().filter(|distance| *distance > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let least = sorted.get(sorted.len().saturating_sub(1) / 2).map_or(0.0, |middle| LEAST_BASELINE * middle);
    let mut found: Vec<usize> = (0..distances.len()).filter(|k| distances[*k] > least).collect();
    found.sort_by(|a, b| distances[*a].total_cmp(&distances[*b]));
    found.truncate(OTHERS);
    found
}

impl<P: Viewpoint> Sweep<P> {
    /// Finds the nearest other photographs, and takes the widest range.
    fn prepare(sweeps: &mut [Self], index: usize) -> Result<(), MatchError> {
        let sweep = &sweeps[index];
        let distances: Vec<f64> = sweeps.iter().map(|other| sweep.camera.distance(&other.camera)).collect();
        let others = nearest(&distances);
        let shift = others
            .iter()
            .map(|k| sweep.camera.displacement(&sweeps[*k].camera, sweep.grey.size()))
            .fold(0.0, f64::max);
        let pixels = |share: f64| (share * sweep.grey.width() as f64) as i32;
        let (low, widest) = match sweep.measure {
            Measure::Disparity => (-pixels(WIDEST), pixels(WIDEST)),
            Measure::Depth => (0, pixels(WIDEST_FROM_FAR)),
        };
        let sweep = &mut sweeps[index];
        (sweep.others, sweep.unit, sweep.range) = (others, (1.0 / shift) as f32, low..widest + 1);
        if shift > 0.0 { Ok(()) } else { Err(MatchError::Alone(index)) }
    }

    /// Takes the range of the parallaxes that were found; without any it stays.
    fn narrow(&mut self, found: &[f32]) {
        let mut known: Vec<f32> = found.iter().map(|v| v / self.unit).filter(|v| !v.is_nan()).collect();
        if known.is_empty() {
            return;
        }
        known.sort_by(f32::total_cmp);
        let stray = (STRAY * known.len() as f64) as usize;
        let (low, high) = (known[stray] - MARGIN, known[known.len() - 1 - stray] + MARGIN);
        self.range = self.range.start.max(low.floor() as i32)..high.ceil() as i32 + 1;
    }

    /// The map of positions and parallaxes to another photograph.
    fn map_to(&self, other: &Self) -> impl Fn([f64; 2], f32) -> ([f64; 2], f32) + Sync {
        let (map, measure) = (self.camera.map_to(&other.camera), self.measure);
        move |[x, y], parallax| {
            let (u, v, there) = map(x, y, f64::from(measure.of_parallax(parallax)));
            ([u, v], measure.parallax(there as f32))
        }
    }

    fn parallaxes(&self, sweeps: &[Self]) -> Vec<f32> {
        let height = self.grey.height();
        let starts: Vec<usize> = (0..height).step_by(ROWS).collect();
        let bands = starts.into_par_iter().map(|y| self.band(sweeps, y..(y + ROWS).min(height)));
        bands.collect::<Vec<_>>().concat()
    }

    fn band(&self, sweeps: &[Self], band: Range<usize>) -> Vec<f32> {
        let (width, height) = self.grey.size();
        let rows = band.start.saturating_sub(LEAD)..(band.end + LEAD).min(height);
        let mut costs = Costs::new(&self.grey, &rows, self.range.len());
        for other in self.others.iter().map(|other| &sweeps[*other]) {
            let map = self.map_to(other);
            for (hypothesis, k) in self.range.clone().enumerate() {
                costs.offer(hypothesis, &other.grey, |place| map(place, k as f32 * self.unit).0);
            }
        }
        let greys = &self.grey.data()[rows.start * width..rows.end * width];
        let sums = aggregate::aggregated(&costs.finished(), greys);
        let pixels = sums.chunks_exact(self.range.len()).skip((band.start - rows.start) * width);
        let best = pixels.take(band.len() * width).map(aggregate::best);
        best.map(|k| (k + self.range.start as f32) * self.unit).collect()
    }

    /// The parallaxes of this photograph, NaN where no other one has the same, to one step, at the point.
    fn confirmed(&self, sweeps: &[Self], found: &[Vec<f32>], index: usize) -> Vec<f32> {
        let width = self.grey.width();
        let maps: Vec<_> = self.others.iter().map(|other| (*other, self.map_to(&sweeps[*other]))).collect();
        let is_confirmed = |p: usize, value: f32| {
            maps.iter().any(|(other, map)| {
                let ([x, y], there) = map([(p % width) as f64, (p / width) as f64], value);
                let pixel = sweeps[*other].grey.pixel_at(x, y);
                pixel.is_some_and(|q| (found[*other][q] - there).abs() <= sweeps[*other].unit)
            })
        };
        let kept = |(p, value): (usize, &f32)| if is_confirmed(p, *value) { *value } else { f32::NAN };
        found[index].iter().enumerate().map(kept).collect()
    }
}

#[cfg(test)]
mod tests;
