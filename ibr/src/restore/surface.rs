//! Surfaces through values with errors, or through few values: the spline fit of the core.
//!
//! Take the slopes along a row and a column of a surface as random walks whose steps have the variance
//! kappa^2, and the errors of the values as white with the variance delta^2. The most probable surface
//! minimises
//!
//! ```text
//! sum_p (d_p - z_p)^2 / delta^2 + sum (z_(p-1) - 2 z_p + z_(p+1))^2 / kappa^2
//! ```
//!
//! so the bending is delta^2 / kappa^2. Across the edges of surfaces the springs are weak; where the edges
//! are is what the last fit shows.

use super::outliers::{Parallax, difference};
use crate::depth::{DepthMap, Measure, Origin};
use crate::image::Image;
use crate::interpolate::Settings;
use crate::interpolate::plane::{PlaneSettings, fit_surface};
use crate::occlusion::DepthTest;
use crate::pipeline::{DEVIATION_PER_MEDIAN, median};
use rayon::prelude::*;

/// Distance over which the bends of a surface are measured: over fewer pixels the errors hide them.
const LAG: usize = 8;

/// Largest bending. The median of the bends is that of planes, and few places bend more: with 200 and 20 the
/// views of poster1 with errors of half a pixel had 32.1 and 33.8 dB.
const MOST_BENDING: f64 = 10.0;

/// The parts of the error of a value that two neighbours on one surface may differ by: in the medians, whose
/// differences have a sixth of it, and in the fits.
const TOLERANCES: [f64; 3] = [0.4, 0.2, 0.15];

/// The share of its parallax by which a value may differ from its neighbour on the same surface.
const SLOPE: f64 = 0.01;

/// A little, so that what bending leaves free is determined.
const STIFFNESS: f64 = 0.02;

impl Parallax {
    /// Removes the noise. Medians begin, by which the edges of surfaces are found. Maps of disparity, from
    /// which rows are rendered, also end with them: they take pixels between two surfaces to one of them. To
    /// the plane these do less harm than outlines that the medians move: 37.0 in place of 39.9 dB on
    /// spheres.
    pub(super) fn smooth(&mut self, image: &Image, measure: Measure) {
        let bending = self.bending();
        let mut shape = self.medians(image);
        for tolerance in TOLERANCES {
            let absolute = tolerance * f64::from(self.error);
            let depth_test = DepthTest { relative: SLOPE, absolute, ..DepthTest::default() };
            let plane = PlaneSettings { stiffness: STIFFNESS, bending, ..PlaneSettings::LINEAR };
            let settings = Settings { plane, depth_test, ..Settings::default() };
            shape = fit_surface(&self.values, &shape, self.width, &settings);
        }
        let known = |(value, shape): (&f32, f32)| if value.is_nan() { f32::NAN } else { shape };
        self.values = self.values.iter().zip(shape).map(known).collect();
        if measure == Measure::Disparity {
            self.values = self.medians(image);
        }
    }

    fn medians(&self, image: &Image) -> Vec<f32> {
        let median = |p: usize| match self.values[p].is_nan() {
            true => f32::NAN,
            false => self.median(image, p),
        };
        (0..self.values.len()).into_par_iter().with_min_len(256).map(median).collect()
    }

    /// delta^2 / kappa^2. Second differences over L pixels have the variance (2 L^3 + L) / 3 kappa^2 + 6
    /// delta^2; their median makes edges harmless.
    fn bending(&self) -> f64 {
        let at = |p: usize| self.values[p];
        let inner = (0..self.values.len()).step_by(7).filter(|p| {
            let x = p % self.width;
            x >= LAG && x + LAG < self.width
        });
        let bend = |p: usize| f64::from(at(p - LAG) - 2.0 * at(p) + at(p + LAG)).abs();
        let mut bends: Vec<f64> = inner.map(bend).filter(|b| b.is_finite()).collect();
        let lag = LAG as f64;
        let error = f64::from(self.error).powi(2);
        let deviation = DEVIATION_PER_MEDIAN * median(&mut bends).unwrap_or(0.0);
        let variance = deviation * deviation - 6.0 * error;
        let kappa = (variance / ((2.0 * lag.powi(3) + lag) / 3.0)).max(error / MOST_BENDING);
        error / kappa
    }
}

/// Cost of a step between pixels per grey level of the difference of their colours, in pixels.
const COST: f32 = 1.0;

/// Sweeps over the image in turn from both corners, in which the shortest paths are found: one for each turn
/// of a path, and most are nearly straight.
const SWEEPS: usize = 6;

/// The splines of scattered values: weak beside the values, and nearly without bonds across edges.
const SCATTERED: PlaneSettings =
    PlaneSettings { stiffness: 0.01, bending: 0.02, edge_stiffness: 1e-5, ..PlaneSettings::LINEAR };

/// The share of its parallax by which a value may differ from its neighbour on the same surface.
const SCATTERED_SLOPE: f64 = 0.015;

/// Lengths of paths from which on a value is a guess, in lower quartiles of these lengths: a quarter of the
/// image has samples about it even where a sky has none. In a photograph of one colour with samples at
/// random these are three mean distances of samples, and one pixel in 10^12 is farther away. On the scenes
/// of `ibr/tests/views/damaged_depth` it is one in 500.
const FAR: f32 = 10.0;

/// Depths for all pixels from those of a few.
///
/// At first each pixel takes the value of the nearest sample, by the length of a path on which differences
/// of colour count. So its surface ends where the colours change. The fit then makes the surfaces smooth.
pub(crate) fn from_scattered(map: &DepthMap, image: &Image) -> DepthMap {
    let (width, measure) = (image.width(), map.measure());
    let values: Vec<f32> = map.data().iter().map(|v| measure.parallax(*v)).collect();
    let (found, lengths) = nearest(&values, image);
    let mut shape: Vec<f32> = found.iter().map(|q| values[*q as usize]).collect();
    let depth_test = DepthTest { relative: SCATTERED_SLOPE, ..DepthTest::default() };
    let settings = Settings { plane: SCATTERED, depth_test, ..Settings::default() };
    for _ in 0..2 {
        shape = fit_surface(&values, &shape, width, &settings);
    }
    let dense = map.with_values(map.size(), shape.into_iter().map(|v| measure.of_parallax(v)).collect());
    // Rows go on where samples of guessed depth count little: on poster1 that would cost a decibel.
    let guessed = if measure == Measure::Depth { far_away(&lengths) } else { Vec::new() };
    dense.with_origins(map, &guessed, Origin::Filled)
}

/// Which pixels are so far from all samples, by the lengths of their paths, that their values are guesses.
fn far_away(lengths: &[f32]) -> Vec<bool> {
    let mut sorted = lengths.to_vec();
    let quartile = *sorted.select_nth_unstable_by(lengths.len() / 4, f32::total_cmp).1;
    // Where every pixel is a sample, nothing is far.
    let limit = FAR * quartile.max(1.0);
    lengths.iter().map(|length| *length > limit).collect()
}

/// The nearest sample of each pixel, and the length of the path to it.
pub(super) fn nearest(values: &[f32], image: &Image) -> (Vec<u32>, Vec<f32>) {
    let (width, height) = image.size();
    let mut found: Vec<u32> = (0..values.len() as u32).collect();
    let mut length: Vec<f32> = values.iter().map(|v| if v.is_nan() { f32::INFINITY } else { 0.0 }).collect();
    let steps: [(isize, isize); 4] = [(-1, 0), (-1, -1), (0, -1), (1, -1)];
    for sweep in 0..SWEEPS {
        let sign = if sweep % 2 == 0 { 1 } else { -1 };
        for k in 0..values.len() {
            let p = if sign == 1 { k } else { values.len() - 1 - k };
            let (x, y) = ((p % width) as isize, (p / width) as isize);
            for (dx, dy) in steps {
                let (i, j) = (x + sign * dx, y + sign * dy);
                if i < 0 || j < 0 || i >= width as isize || j >= height as isize {
                    continue;
                }
                let q = j as usize * width + i as usize;
                let step =
                    ((dx * dx + dy * dy) as f32).sqrt() + COST * difference(image.pixel(p), image.pixel(q));
                if length[q] + step < length[p] {
                    (length[p], found[p]) = (length[q] + step, found[q]);
                }
            }
        }
    }
    (found, length)
}
