//! Conjugate gradients, one channel after the other: with diagonal preconditioner, and with multigrid from
//! there on where that does not converge soon.

use super::multigrid::Multigrid;
use super::stencil::Stencil;
use super::{Convergence, PlaneSettings};
use crate::interpolate::Watch;
use rayon::prelude::*;

/// Entries per chunk. Partial sums of a dot product follow the chunks, not the threads, so the bits do not
/// depend on them.
const CHUNK: usize = 8192;

/// Steps with the diagonal preconditioner. Fits without large holes end earlier; a multigrid step costs four
/// times as much.
const DIAGONAL_STEPS: usize = 50;

/// Solves A u = rhs for every channel; returns the values interleaved, in the memory of the right-hand
/// sides.
pub(super) fn solve<const C: usize>(
    stencil: &Stencil,
    mut rhs: Vec<[f32; C]>,
    settings: &PlaneSettings,
    watch: Watch<'_>,
) -> (Vec<f32>, Convergence) {
    let mut ended = Convergence { reached: true, ..Convergence::default() };
    let mut work = Work::new(rhs.len());
    let mut multigrid = None;
    for channel in 0..C {
        let of_channel = |share: f64| watch((channel as f64 + share) / C as f64);
        let first = PlaneSettings { iterations: settings.iterations.min(DIAGONAL_STEPS), ..*settings };
        let mut one = work.solve(stencil, |p| f64::from(rhs[p][channel]), &first, &of_channel);
        if !one.reached {
            let multigrid = multigrid.get_or_insert_with(|| Multigrid::new(stencil));
            let rhs = |p: usize| f64::from(rhs[p][channel]);
            one = work.continue_with(stencil, multigrid, rhs, settings, one.steps, &of_channel);
        }
        ended.steps = ended.steps.max(one.steps);
        ended.residual = ended.residual.max(one.residual);
        ended.reached &= one.reached;
        rhs.iter_mut().zip(&work.u).for_each(|(r, u)| r[channel] = *u as f32);
    }
    (rhs.into_flattened(), ended)
}

/// The four vectors of the iteration.
struct Work {
    u: Vec<f64>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    /// Partial sums of dot products: one per image row or per chunk, never more than pixels.
    partial: Vec<f64>,
}

impl Work {
    fn new(n: usize) -> Self {
        let zeros = || vec![0.0; n];
        Self { u: zeros(), residual: zeros(), direction: zeros(), image: zeros(), partial: Vec::new() }
    }

    /// Starts from the splatted image rhs / diag, the solution without smoothing.
    fn solve(
        &mut self,
        a: &Stencil,
        rhs: impl Fn(usize) -> f64,
        settings: &PlaneSettings,
        watch: &dyn Fn(f64),
    ) -> Convergence {
        let rows = self.u.len();
        self.partial.resize(a.rows().max(rows.div_ceil(CHUNK)), 0.0);
        (0..rows).for_each(|p| self.u[p] = rhs(p) / a.diagonal(p));
        self.multiply_start(a);
        (0..rows).for_each(|p| self.residual[p] = rhs(p) - self.image[p]);
        (0..rows).for_each(|p| self.direction[p] = self.residual[p] / a.diagonal(p));
        let scale: f64 =
            (0..rows).map(|p| rhs(p) * rhs(p) / a.diagonal(p)).sum::<f64>().max(f64::MIN_POSITIVE);
        let mut energy: f64 = (0..rows).map(|p| self.residual[p] * self.direction[p]).sum();
        let mut steps = 0;
        while steps < settings.iterations && energy > scale * settings.tolerance * settings.tolerance {
            let curvature = a.multiply(&self.direction, &mut self.image, partials(&mut self.partial, a));
            if !(curvature.is_finite() && curvature > 0.0) {
                break;
            }
            let next = self.step(a, energy / curvature);
            self.turn(a, next / energy);
            energy = next;
            steps += 1;
            watch(done(energy / scale, settings));
        }
        let residual = (energy / scale).sqrt();
        Convergence { steps, residual, reached: residual <= settings.tolerance }
    }

    /// Goes on from u with the multigrid preconditioner.
    fn continue_with(
        &mut self,
        a: &Stencil,
        multigrid: &mut Multigrid,
        rhs: impl Fn(usize) -> f64,
        settings: &PlaneSettings,
        mut steps: usize,
        watch: &dyn Fn(f64),
    ) -> Convergence {
        let pixels = self.u.len();
        let scale: f64 =
            (0..pixels).map(|p| rhs(p) * rhs(p) / a.diagonal(p)).sum::<f64>().max(f64::MIN_POSITIVE);
        self.multiply_start(a);
        (0..pixels).for_each(|p| self.residual[p] = rhs(p) - self.image[p]);
        multigrid.apply(a, &self.residual, &mut self.direction);
        let mut preconditioned = vec![0.0; pixels];
        let mut product = self.dot(&self.direction);
        let mut energy =
            (0..pixels).map(|p| self.residual[p] * self.residual[p] / a.diagonal(p)).sum::<f64>();
        while steps < settings.iterations && energy > scale * settings.tolerance * settings.tolerance {
            let curvature = a.multiply(&self.direction, &mut self.image, partials(&mut self.partial, a));
            if !(curvature.is_finite() && curvature > 0.0) {
                break;
            }
            energy = self.step(a, product / curvature);
            multigrid.apply(a, &self.residual, &mut preconditioned);
            let next = self.dot(&preconditioned);
            let factor = next / product;
            self.direction.iter_mut().zip(&preconditioned).for_each(|(d, z)| *d = z + factor * *d);
            product = next;
            steps += 1;
            watch(done(energy / scale, settings));
        }
        let residual = (energy / scale).sqrt();
        Convergence { steps, residual, reached: residual <= settings.tolerance }
    }

    /// residual . v
    fn dot(&self, v: &[f64]) -> f64 {
        self.residual.iter().zip(v).map(|(r, v)| r * v).sum()
    }

    /// image = A u.
    fn multiply_start(&mut self, a: &Stencil) {
        a.multiply(&self.u, &mut self.image, partials(&mut self.partial, a));
    }

    /// Steps by `length` along the direction; returns r . D^{-1} r of the new residual.
    fn step(&mut self, a: &Stencil, length: f64) -> f64 {
        let chunks = self.u.len().div_ceil(CHUNK);
        let blocks = self.u.par_chunks_mut(CHUNK).zip(self.residual.par_chunks_mut(CHUNK));
        let inputs = self.direction.par_chunks(CHUNK).zip(self.image.par_chunks(CHUNK));
        blocks.zip(inputs).zip(self.partial[..chunks].par_iter_mut()).enumerate().for_each(
            |(k, (((u, r), (p, q)), sum))| {
                *sum = 0.0;
                for i in 0..u.len() {
                    u[i] += length * p[i];
                    r[i] -= length * q[i];
                    *sum += r[i] * r[i] / a.diagonal(k * CHUNK + i);
                }
            },
        );
        self.partial[..chunks].iter().sum()
    }

    /// direction = D^{-1} residual + factor direction.
    fn turn(&mut self, a: &Stencil, factor: f64) {
        let blocks = self.direction.par_chunks_mut(CHUNK).zip(self.residual.par_chunks(CHUNK));
        blocks.enumerate().for_each(|(k, (p, r))| {
            for i in 0..p.len() {
                p[i] = r[i] / a.diagonal(k * CHUNK + i) + factor * p[i];
            }
        });
    }
}

/// Share of the way to the tolerance: the residual falls by about one factor per step.
fn done(energy: f64, settings: &PlaneSettings) -> f64 {
    let (now, end) = (energy.max(f64::MIN_POSITIVE).ln(), 2.0 * settings.tolerance.ln());
    if end < 0.0 { (now / end).clamp(0.0, 1.0) } else { 1.0 }
}

/// One partial sum per image row.
fn partials<'a>(partial: &'a mut [f64], a: &Stencil) -> &'a mut [f64] {
    &mut partial[..a.rows()]
}
