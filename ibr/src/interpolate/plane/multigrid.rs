//! A multigrid preconditioner for fits with large holes, where the diagonal one needs as many steps as a
//! hole has pixels across.
//!
//! Coarse unknowns stand for blocks of 2 x 2 pixels (unsmoothed aggregation, Galerkin matrices). A block
//! that moves as a whole is too stiff, so the coarse correction is multiplied by a factor (Braess 1995).

use super::stencil::Stencil;
use rayon::prelude::*;

/// Damping of the Jacobi steps. The eigenvalues of D^{-1} A stay below 8/3 (bending), so the steps contract.
const DAMPING: f64 = 0.6;
/// Factor of the coarse correction; below 2 the preconditioner stays positive definite.
const CORRECTION: f64 = 1.5;
/// Unknowns of the coarsest matrix, at most, and Jacobi steps on it.
const COARSEST: usize = 64;
const COARSEST_STEPS: usize = 40;

/// The matrices from the second finest down, with work memory for all levels.
pub(super) struct Multigrid {
    coarse: Vec<Stencil>,
    work: Vec<Work>,
}

/// Vectors of one level.
struct Work {
    rhs: Vec<f64>,
    solution: Vec<f64>,
    image: Vec<f64>,
    partial: Vec<f64>,
}

impl Work {
    fn of(stencil: &Stencil) -> Self {
        let zeros = || vec![0.0; stencil.pixels()];
        Self { rhs: zeros(), solution: zeros(), image: zeros(), partial: vec![0.0; stencil.rows()] }
    }
}

impl Multigrid {
    pub(super) fn new(finest: &Stencil) -> Self {
        let mut coarse: Vec<Stencil> = Vec::new();
        loop {
            let last = coarse.last().unwrap_or(finest);
            if last.pixels() <= COARSEST {
                break;
            }
            coarse.push(last.coarsened());
        }
        let work = std::iter::once(finest).chain(&coarse).map(Work::of).collect();
        Self { coarse, work }
    }

    /// out = M^{-1} residual: one symmetric V-cycle.
    pub(super) fn apply(&mut self, finest: &Stencil, residual: &[f64], out: &mut [f64]) {
        self.work[0].rhs.copy_from_slice(residual);
        self.cycle(finest, 0);
        out.copy_from_slice(&self.work[0].solution);
    }

    fn cycle(&mut self, finest: &Stencil, level: usize) {
        let last = level == self.coarse.len();
        let a = if level == 0 { finest } else { &self.coarse[level - 1] };
        self.work[level].solution.fill(0.0);
        (0..if last { COARSEST_STEPS } else { 1 }).for_each(|_| smooth(a, &mut self.work[level]));
        if last {
            return;
        }
        let (above, below) = self.work.split_at_mut(level + 1);
        restrict(a, &mut above[level], &mut below[0]);
        self.cycle(finest, level + 1);
        let a = if level == 0 { finest } else { &self.coarse[level - 1] };
        let (above, below) = self.work.split_at_mut(level + 1);
        correct(a, &mut above[level], &below[0].solution);
        smooth(a, &mut above[level]);
    }
}

/// solution += DAMPING D^{-1} (rhs - A solution).
fn smooth(a: &Stencil, work: &mut Work) {
    let Work { rhs, solution, image, partial } = work;
    a.multiply(solution, image, partial);
    let rows =
        solution.par_chunks_mut(a.width()).zip(rhs.par_chunks(a.width())).zip(image.par_chunks(a.width()));
    rows.enumerate().with_min_len(8).for_each(|(y, ((solution, rhs), image))| {
        for x in 0..solution.len() {
            solution[x] += DAMPING * (rhs[x] - image[x]) / a.diagonal(y * a.width() + x);
        }
    });
}

/// The residual of a level, summed over blocks: the right-hand side of the next.
fn restrict(a: &Stencil, work: &mut Work, next: &mut Work) {
    a.multiply(&work.solution, &mut work.image, &mut work.partial);
    next.rhs.fill(0.0);
    for (p, (rhs, image)) in work.rhs.iter().zip(&work.image).enumerate() {
        next.rhs[a.block(p)] += rhs - image;
    }
}

/// Adds the coarse solution to all pixels of its blocks.
fn correct(a: &Stencil, work: &mut Work, coarse: &[f64]) {
    work.solution.iter_mut().enumerate().for_each(|(p, u)| *u += CORRECTION * coarse[a.block(p)]);
}
