//! The plane fit: the whole virtual image at once, for samples at any position (the row fit in two
//! dimensions).
//!
//! With u the pixels, B_s the bilinear weights of sample s and g_pq the stiffness of the edge between
//! neighbouring pixels p and q, minimise
//!
//! ```text
//! sum_s w_s (I_s - sum_p B_sp u_p)^2 + sum_pq g_pq (u_p - u_q)^2 + sum_pqr h_pqr (u_p - 2 u_q + u_r)^2,
//! g_pq = stiffness / (1 + ((D_p - D_q) / k)^2) + edge_stiffness,   h_pqr = bending / (1 + (range D / k)^2)
//! ```
//!
//! over neighbours pq and triples pqr in a row or column, where (D_p - D_q) / k is the depth difference in
//! units of the depth test's sigma. The bending term smooths like a cubic spline: it removes noise and keeps
//! slopes. Each equation has thirteen unknowns; conjugate gradients solve them for all channels together,
//! with a multigrid preconditioner where holes are large.

mod background;
mod conjugate;
mod gather;
mod multigrid;
mod springs;
mod stencil;

use super::{Cover, HoleFill, InterpolationError, Settings, Watch};
use crate::depth::{DepthMap, Measure};
use crate::sample::Sample;
use springs::Springs;
use stencil::Stencil;

/// Settings of the plane fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneSettings {
    /// Weight of the squared difference of neighbouring pixels on one surface.
    pub stiffness: f64,
    /// Weight of the squared second difference within one surface.
    pub bending: f64,
    /// The part of the stiffness that remains across depth edges.
    pub edge_stiffness: f64,
    /// Relative residual at which the conjugate gradients stop.
    pub tolerance: f64,
    /// Most steps of the conjugate gradients per channel.
    pub iterations: usize,
}

impl Default for PlaneSettings {
    fn default() -> Self {
        Self { stiffness: 0.12, bending: 0.02, edge_stiffness: 1e-3, tolerance: 3e-5, iterations: 500 }
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

/// The result of the plane fit.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneFit {
    /// Values 0..255, `width * height * C`.
    pub values: Vec<f32>,
    /// Origin of each pixel's value.
    pub mask: Vec<Cover>,
    /// Depth of the sample nearest to each pixel, NaN in holes.
    pub depth: DepthMap,
    /// Visible samples that are nearest to each pixel.
    pub counts: Vec<u16>,
    /// Convergence of the solver.
    pub convergence: Convergence,
}

/// Least weight of the samples on a pixel that is continued into holes; below it they are doubtful, or lie
/// beside the pixel.
const LEAST_SOURCE_WEIGHT: f32 = 0.3;

/// Collects visible samples, all at once or band by band, and then fits the image.
#[derive(Debug, Clone)]
pub struct PlaneProblem<const C: usize> {
    width: usize,
    height: usize,
    stencil: Stencil,
    rhs: Vec<[f32; C]>,
    /// Depth of the sample nearest to each pixel centre, NaN where none lies within half a gap.
    depth: Vec<f32>,
    /// Squared distance of that sample.
    distance: Vec<f32>,
    counts: Vec<u16>,
    settings: Settings,
    added: usize,
}

impl<const C: usize> PlaneProblem<C> {
    /// An empty problem.
    ///
    /// # Errors
    /// [`InterpolationError::Setting`].
    pub fn new((width, height): (usize, usize), settings: &Settings) -> Result<Self, InterpolationError> {
        settings.check()?;
        let pixels = width * height;
        Ok(Self {
            width,
            height,
            stencil: Stencil::new(width, height),
            rhs: vec![[0.0; C]; pixels],
            depth: vec![f32::NAN; pixels],
            distance: vec![f32::INFINITY; pixels],
            counts: vec![0; pixels],
            settings: *settings,
            added: 0,
        })
    }

    /// Samples that have been added.
    pub fn samples(&self) -> usize {
        self.added
    }

    /// Whether a sample lies within half a gap of each pixel.
    pub fn seen(&self) -> impl Iterator<Item = bool> + '_ {
        self.depth.iter().map(|d| !d.is_nan())
    }

    /// Fits the image. With `region`, only the pixels where it is true are filled and fitted together;
    /// all others become black disocclusions.
    ///
    /// # Errors
    /// [`InterpolationError::NoSamples`] when no sample was added.
    pub fn solve(self, region: Option<&[bool]>) -> Result<PlaneFit, InterpolationError> {
        self.solve_watched(region, &|_| ())
    }

    /// As [`PlaneProblem::solve`]; `watch` is called with the share of the fit that is done.
    ///
    /// # Errors
    /// As [`PlaneProblem::solve`].
    pub fn solve_watched(
        mut self,
        region: Option<&[bool]>,
        watch: Watch<'_>,
    ) -> Result<PlaneFit, InterpolationError> {
        let (width, height) = (self.width, self.height);
        if self.added == 0 {
            return Err(InterpolationError::NoSamples { width, height });
        }
        let inside = |p: usize| region.is_none_or(|r| r.get(p).copied().unwrap_or(false));
        let mut mask = background::classify(&self.depth, width, &self.settings.depth_test);
        self.distance = Vec::new();
        let depth = DepthMap::from_known((width, height), self.depth.clone(), Measure::Depth);
        let background = self.settings.holes.fill == HoleFill::Background;
        if background && mask.contains(&Cover::Disocclusion) {
            self.fill_background(&mask, &inside);
        }
        let left_out = self.settings.holes.fill == HoleFill::Leave;
        let fitted = |p: usize| inside(p) && !(left_out && mask[p] != Cover::Seen);
        self.connect(&(0..width * height).map(fitted).collect::<Vec<_>>());
        self.depth = Vec::new();
        let (mut values, convergence) =
            conjugate::solve(&self.stencil, self.rhs, &self.settings.plane, watch);
        (0..width * height).filter(|p| !inside(*p)).for_each(|p| {
            mask[p] = Cover::Disocclusion;
            values[p * C..(p + 1) * C].fill(0.0);
        });
        if self.settings.holes.fill == HoleFill::Leave {
            super::rows::blacken(&mask, &mut values, C);
        }
        values.iter_mut().for_each(|v| *v = v.clamp(0.0, 255.0));
        Ok(PlaneFit { values, mask, depth, counts: self.counts, convergence })
    }

    /// Gives every disoccluded pixel a sample with value and depth of the surface that continues into it.
    fn fill_background(&mut self, mask: &[Cover], inside: &dyn Fn(usize) -> bool) {
        let sound = |(p, depth): (usize, &f32)| {
            if self.stencil.sample_weight(p) < LEAST_SOURCE_WEIGHT { f32::NAN } else { *depth }
        };
        let sound: Vec<f32> = self.depth.iter().enumerate().map(sound).collect();
        let sources = background::sources(&sound, self.width, &self.settings.depth_test);
        for p in (0..mask.len()).filter(|p| mask[*p] == Cover::Disocclusion && inside(*p)) {
            let Some(source) = sources[p].map(|s| s as usize) else { continue };
            self.depth[p] = self.depth[source];
            // The value of a seen pixel before the fit: its share of the right-hand side. A sample on a
            // pixel centre affects that pixel only, so no source changes in this loop.
            let weight = self.stencil.sample_weight(source);
            let value = self.rhs[source].map(|r| r / weight);
            self.add_on_pixel(p, &value);
        }
    }

    /// Adds the edges between neighbouring pixels and the bends of triples.
    fn connect(&mut self, inside: &[bool]) {
        for down in [false, true] {
            let springs = Springs::new(&self.depth, self.width, inside, &self.settings, down);
            self.stencil.add_springs(&springs.edge, &springs.bend, down);
        }
        inside.iter().enumerate().filter(|(_, i)| !**i).for_each(|(p, _)| self.stencil.isolate(p));
    }
}

/// The complete third stage for samples at any position: a value for every pixel, and the mask.
///
/// # Errors
/// [`InterpolationError`]: settings, samples that are not finite, and no sample at all.
pub fn interpolate<const C: usize>(
    samples: &[Sample<C>],
    size: (usize, usize),
    settings: &Settings,
) -> Result<PlaneFit, InterpolationError> {
    let mut problem = PlaneProblem::new(size, settings)?;
    problem.add(samples)?;
    problem.solve(None)
}

#[cfg(test)]
mod tests;
