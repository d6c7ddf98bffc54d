//! The plane fit: the whole virtual image at once, for samples at any position (the row fit in two
//! dimensions).
//!
//! With u the coefficients of a bilinear or bicubic spline, B_s its weights at sample s and g_pq the
//! stiffness of the edge between neighbouring coefficients p and q, minimise
//!
//! ```text
//! sum_s w_s (I_s - sum_p B_sp u_p)^2 + sum_pq g_pq (u_p - u_q)^2 + sum_pqr h_pqr (u_p - 2 u_q + u_r)^2,
//! g_pq = stiffness / (1 + ((D_p - D_q) / k)^2) + edge_stiffness,   h_pqr = bending / (1 + (range D / k)^2)
//! ```
//!
//! over neighbours pq and triples pqr in a row or column, where (D_p - D_q) / k is the depth difference in
//! units of the depth test's sigma. The coefficients of the bilinear spline are the pixels. Its bending term
//! smooths like a cubic spline: it removes noise and keeps slopes. [`hybank_sampling::fit2`] holds and
//! solves the equations.

mod background;
mod gather;
mod grid;
mod springs;

use super::extend::{Level, mean};
use super::{Cover, Degree, HoleFill, Settings};
use crate::depth::{DepthMap, Measure, NONE};
use grid::Grid;
use hybank_sampling::Fit2;
use hybank_sampling::fit2::Fit2Sample;
use rayon::prelude::*;

/// Settings of the plane fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneSettings {
    /// Degree of the splines.
    pub degree: Degree,
    /// Weight of the squared difference of neighbouring coefficients on one surface.
    pub stiffness: f64,
    /// The least such weight that the noise of the samples demands.
    pub noise_stiffness: f64,
    /// Weight of the squared second difference within one surface.
    pub bending: f64,
    /// The part of the stiffness that remains across depth edges.
    pub edge_stiffness: f64,
    /// Relative residual at which the conjugate gradients stop.
    pub tolerance: f64,
    /// Most steps of the conjugate gradients per channel.
    pub iterations: usize,
}

impl PlaneSettings {
    /// Bilinear splines.
    pub const LINEAR: Self = Self {
        degree: Degree::Linear,
        stiffness: 0.12,
        noise_stiffness: 0.0,
        bending: 0.02,
        edge_stiffness: 1e-3,
        tolerance: 3e-5,
        iterations: 500,
    };

    /// Bicubic splines: the sharper image. They are smooth without bending, and need less stiffness, as they
    /// follow what bilinear splines take for noise. Where all holes have samples, views that stop at this
    /// tolerance differ by 0.1 grey levels from those that go on, and by 0.01 dB.
    pub const CUBIC: Self =
        Self { degree: Degree::Cubic, stiffness: 0.02, bending: 0.0, tolerance: 1e-4, ..Self::LINEAR };
}

impl Default for PlaneSettings {
    fn default() -> Self {
        Self::CUBIC
    }
}

/// Convergence of the conjugate gradients.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Convergence {
    /// Steps taken, the most over the channels.
    pub steps: usize,
    /// Relative residual reached, the largest over the channels.
    pub residual: f64,
    /// Whether every channel reached the tolerance within the allowed steps.
    pub reached: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PlaneFit {
    /// Values 0..255, `width * height * C`.
    pub(crate) values: Vec<f32>,
    pub(crate) mask: Vec<Cover>,
    /// Depth of the sample nearest to each pixel, NaN in holes.
    pub(crate) depth: DepthMap,
    pub(crate) counts: Vec<u16>,
    pub(crate) convergence: Convergence,
}

/// Least weight of the samples on a pixel that is continued into holes; below it they are doubtful, or lie
/// beside the pixel.
const LEAST_SOURCE_WEIGHT: f32 = 0.3;

/// Largest tolerance where holes have no samples: there an error has a residual in proportion to the root of
/// the stiffness.
const BRIDGING_TOLERANCE: f64 = 1.2e-5;

/// Weight of the samples that are put into cracks. The springs decide there; without samples the conjugate
/// gradients take twice the steps.
const CRACK_WEIGHT: f32 = 0.05;

/// Added to the squared distance of a sample of guessed depth: any other one that reaches a pixel is nearer.
const GUESSED: f32 = 1e4;

/// Collects visible samples, all at once or band by band, and then fits the image.
#[derive(Debug, Clone)]
pub(crate) struct PlaneProblem<const ORDER: usize, const C: usize> {
    width: usize,
    height: usize,
    fit: Fit2<ORDER, C>,
    /// Depth of the sample nearest to each pixel centre, NaN where none lies within half a gap.
    depth: Vec<f32>,
    /// Squared distance of that sample, and [`GUESSED`] if its depth is a guess.
    distance: Vec<f32>,
    counts: Vec<u16>,
    settings: Settings,
    /// Samples that have been added, and the sum of the areas that they stand for.
    count: usize,
    area: f64,
}

impl<const ORDER: usize, const C: usize> PlaneProblem<ORDER, C> {
    pub(crate) fn new((width, height): (usize, usize), settings: &Settings) -> Self {
        let pixels = width * height;
        // Written at once: pages that are read first and written later take the system twice the time.
        let mut counts = vec![0; pixels];
        counts.par_chunks_mut(width.max(1)).for_each(|row| row.fill(0));
        Self {
            width,
            height,
            fit: Fit2::new(width, height),
            depth: vec![f32::NAN; pixels],
            distance: vec![f32::INFINITY; pixels],
            counts,
            settings: *settings,
            count: 0,
            area: 0.0,
        }
    }

    pub(crate) fn samples(&self) -> usize {
        self.count
    }

    /// Fits the image.
    pub(crate) fn solve(mut self) -> PlaneFit {
        let (width, height) = (self.width, self.height);
        let mut mask = background::classify(&self.depth, width, &self.settings.depth_test);
        let guessed = mask.iter_mut().zip(std::mem::take(&mut self.distance));
        let guessed = guessed.filter(|(cover, distance)| **cover == Cover::Seen && *distance >= GUESSED);
        guessed.for_each(|(cover, _)| *cover = Cover::Guessed);
        if self.settings.fill == HoleFill::Background && mask.iter().any(|cover| cover.is_hole()) {
            self.fill_background(&mask);
        }
        let left_out = self.settings.fill == HoleFill::Leave;
        let fitted = |p: usize| !(left_out && mask[p].is_hole());
        let (counts, mut depth) = (std::mem::take(&mut self.counts), std::mem::take(&mut self.depth));
        let plane = &mut self.settings.plane;
        plane.stiffness = plane.stiffness.max(plane.noise_stiffness);
        if self.settings.fill == HoleFill::Bridge {
            plane.tolerance = plane.tolerance.min(BRIDGING_TOLERANCE);
        }
        let (mut values, ended) = springs::solve(self.fit, (width, height), &depth, &fitted, &self.settings);
        let hybank_sampling::fit2::Convergence { steps, residual, reached } = ended;
        // The depths that were continued into holes are those of the springs only.
        let holes = depth.iter_mut().zip(&mask).filter(|(_, cover)| **cover != Cover::Seen);
        holes.for_each(|(depth, _)| *depth = f32::NAN);
        if left_out {
            super::rows::blacken(&mask, &mut values, C);
        }
        values.iter_mut().for_each(|v| *v = v.clamp(0.0, 255.0));
        let depth = DepthMap::from_known((width, height), depth, Measure::Depth);
        PlaneFit { values, mask, depth, counts, convergence: Convergence { steps, residual, reached } }
    }

    /// Gives every disoccluded pixel a sample with value and depth of the surface that continues into it,
    /// and every pixel of a crack a weak one with the value of what lies around it.
    fn fill_background(&mut self, mask: &[Cover]) {
        let grid = Grid::new((self.width, self.height), &self.fit);
        let weights = self.fit.weights();
        let sound = |(p, depth): (usize, &f32)| {
            if weights[grid.coefficient(p)] < LEAST_SOURCE_WEIGHT { f32::NAN } else { *depth }
        };
        let sound: Vec<f32> = self.depth.par_iter().enumerate().map(sound).collect();
        // The value of a seen pixel before the fit: its share of the right-hand side. The new samples must
        // not count in it.
        let value = |p: usize| {
            let coefficient = grid.coefficient(p);
            self.fit.weighted_values(coefficient).map(|v| v / weights[coefficient])
        };
        let bridged = background::bridged(&sound, self.width, mask, value);
        let sources = background::sources(&sound, self.width, &self.settings.depth_test);
        let mut is_source = vec![false; sound.len()];
        drop(sound);
        let holes = (0..mask.len()).filter(|p| mask[*p] == Cover::Disocclusion && sources[*p] != NONE);
        holes.clone().for_each(|p| is_source[sources[p] as usize] = true);
        let values = (0..mask.len()).map(|p| if is_source[p] { value(p) } else { [0.0; C] }).collect();
        let weights = is_source.iter().map(|is_source| f32::from(u8::from(*is_source))).collect();
        let continued = Level { width: self.width, values, weights };
        let extension = continued.extension();
        for p in holes {
            let source = sources[p] as usize;
            self.depth[p] = self.depth[source];
            self.add_on_pixel(p, mean(continued.values[source], extension(p)), 1.0);
        }
        bridged.into_iter().for_each(|(p, value)| self.add_on_pixel(p, value, CRACK_WEIGHT));
    }
}

/// The bilinear spline through values on pixels, NaN where there are none, with the springs of the surfaces
/// that a `shape` shows.
pub(crate) fn fit_surface(values: &[f32], shape: &[f32], width: usize, settings: &Settings) -> Vec<f32> {
    let size = (width, values.len() / width.max(1));
    let mut fit = Fit2::<2, 1>::new(size.0, size.1);
    let mut rows = fit.rows();
    for (p, value) in values.iter().enumerate().filter(|(_, value)| !value.is_nan()) {
        let (x, y) = ((p % width) as f64, (p / width) as f64);
        rows.add(&Fit2Sample { x, y, values: [*value], weight: 1.0 });
    }
    springs::solve(fit, size, shape, &|_| true, settings).0
}

#[cfg(test)]
mod tests;
