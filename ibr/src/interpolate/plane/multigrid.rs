//! A multigrid preconditioner for fits with large holes, where the diagonal one needs as many steps as a
//! hole has pixels across.
//!
//! Coarse unknowns stand for blocks of 2 x 2 pixels (unsmoothed aggregation, Galerkin matrices). A block
//! that moves as a whole is too stiff, so the coarse correction is multiplied by a factor (Braess 1995).

use super::stencil::Stencil;
use rayon::prelude::*;

/// Damping of the Jacobi steps. The eigenvalues of D^{-1} A stay below 8/3 (bending), so the steps contract.
const DAMPING: f32 = 0.6;
/// Factor of the coarse correction; below 2 the preconditioner stays positive definite.
const CORRECTION: f32 = 1.5;
/// Unknowns of the coarsest matrix, at most, and Jacobi steps on it.
const COARSEST: usize = 64;
const COARSEST_STEPS: usize = 40;

/// The matrices from the second finest down, with work memory for all levels.
pub(super) struct Multigrid<const L: usize> {
    coarse: Vec<Stencil>,
    work: Vec<Work<L>>,
}

/// Vectors of one level.
struct Work<const L: usize> {
    rhs: Vec<[f32; L]>,
    solution: Vec<[f32; L]>,
    image: Vec<[f32; L]>,
    partial: Vec<[f64; L]>,
}

impl<const L: usize> Work<L> {
    fn of(stencil: &Stencil) -> Self {
        let zeros = || vec![[0.0; L]; stencil.pixels()];
        Self { rhs: zeros(), solution: zeros(), image: zeros(), partial: vec![[0.0; L]; stencil.rows()] }
    }
}

impl<const L: usize> Multigrid<L> {
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
    pub(super) fn apply(&mut self, finest: &Stencil, residual: &[[f32; L]], out: &mut [[f32; L]]) {
        self.work[0].rhs.copy_from_slice(residual);
        self.cycle(finest, 0);
        out.copy_from_slice(&self.work[0].solution);
    }

    fn cycle(&mut self, finest: &Stencil, level: usize) {
        let last = level == self.coarse.len();
        let a = if level == 0 { finest } else { &self.coarse[level - 1] };
        self.work[level].solution.fill([0.0; L]);
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
fn smooth<const L: usize>(a: &Stencil, work: &mut Work<L>) {
    let Work { rhs, solution, image, partial } = work;
    a.multiply(solution, image, partial);
    let rows =
        solution.par_chunks_mut(a.width()).zip(rhs.par_chunks(a.width())).zip(image.par_chunks(a.width()));
    rows.enumerate().with_min_len(8).for_each(|(y, ((solution, rhs), image))| {
        let mut x = 0;
        while x < solution.len() {
            let (share, mut c) = (DAMPING / a.diagonal(y * a.width() + x), 0);
            while c < L {
                solution[x][c] += share * (rhs[x][c] - image[x][c]);
                c += 1;
            }
            x += 1;
        }
    });
}

/// The residual of a level, summed over blocks: the right-hand side of the next.
fn restrict<const L: usize>(a: &Stencil, work: &mut Work<L>, next: &mut Work<L>) {
    a.multiply(&work.solution, &mut work.image, &mut work.partial);
    next.rhs.fill([0.0; L]);
    for (p, (rhs, image)) in work.rhs.iter().zip(&work.image).enumerate() {
        let sum = &mut next.rhs[a.block(p)];
        (0..L).for_each(|c| sum[c] += rhs[c] - image[c]);
    }
}

/// Adds the coarse solution to all pixels of its blocks.
fn correct<const L: usize>(a: &Stencil, work: &mut Work<L>, coarse: &[[f32; L]]) {
    work.solution.par_iter_mut().enumerate().with_min_len(4096).for_each(|(p, u)| {
        let block = &coarse[a.block(p)];
        (0..L).for_each(|c| u[c] += CORRECTION * block[c]);
    });
}
