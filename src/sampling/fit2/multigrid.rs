//! A multigrid preconditioner for fits with large holes, where the diagonal one needs as many steps as a
//! hole has coefficients across.
//!
//! Coarse unknowns stand for blocks of 2 x 2 (unsmoothed aggregation, Galerkin matrices). A block that moves
//! as a whole is too stiff, so the coarse correction is multiplied by a factor (Braess 1995).

use super::planes::{Planes, ROWS_AT_ONCE};
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
pub(super) struct Multigrid<const C: usize> {
    coarse: Vec<Stencil>,
    work: Vec<Work<C>>,
}

/// Vectors of one level.
struct Work<const C: usize> {
    rhs: Planes,
    solution: Planes,
    image: Planes,
}

impl<const C: usize> Work<C> {
    fn of(stencil: &Stencil) -> Self {
        let zeros = || Planes::zeros(stencil.grid(), C);
        Self { rhs: zeros(), solution: zeros(), image: zeros() }
    }
}

impl<const C: usize> Multigrid<C> {
    pub(super) fn new(finest: &Stencil) -> Self {
        let mut coarse: Vec<Stencil> = Vec::new();
        loop {
            let last = coarse.last().unwrap_or(finest);
            if last.grid().len() <= COARSEST {
                break;
            }
            coarse.push(last.coarsened());
        }
        let work = std::iter::once(finest).chain(&coarse).map(Work::of).collect();
        Self { coarse, work }
    }

    /// out = M^{-1} residual: one symmetric V-cycle.
    pub(super) fn apply(&mut self, finest: &Stencil, residual: &Planes, out: &mut Planes) {
        self.work[0].rhs.clone_from(residual);
        self.cycle(finest, 0);
        out.clone_from(&self.work[0].solution);
    }

    fn cycle(&mut self, finest: &Stencil, level: usize) {
        let last = level == self.coarse.len();
        let a = if level == 0 { finest } else { &self.coarse[level - 1] };
        self.work[level].start(a);
        if last {
            (1..COARSEST_STEPS).for_each(|_| self.work[level].smooth(a));
            return;
        }
        let (above, below) = self.work.split_at_mut(level + 1);
        above[level].restrict(a, &mut below[0]);
        self.cycle(finest, level + 1);
        let a = if level == 0 { finest } else { &self.coarse[level - 1] };
        let (above, below) = self.work.split_at_mut(level + 1);
        above[level].correct(&below[0].solution);
        above[level].smooth(a);
    }
}

impl<const C: usize> Work<C> {
    /// The Jacobi step from 0: solution = DAMPING D^{-1} rhs.
    fn start(&mut self, a: &Stencil) {
        let rows = self.solution.par_rows_mut().zip(self.rhs.par_rows());
        rows.enumerate().with_min_len(ROWS_AT_ONCE).for_each(|(y, (solution, rhs))| {
            let diagonal = a.diagonal_row(y);
            let channels = solution.chunks_mut(diagonal.len()).zip(rhs.chunks(diagonal.len()));
            for (solution, rhs) in channels {
                for ((u, r), d) in solution.iter_mut().zip(rhs).zip(diagonal) {
                    *u = if *d > 0.0 { DAMPING / d * r } else { 0.0 };
                }
            }
        });
    }

    /// A Jacobi step: solution += DAMPING D^{-1} (rhs - A solution).
    fn smooth(&mut self, a: &Stencil) {
        a.multiply::<C>(&self.solution, &mut self.image);
        let rows = self.solution.par_rows_mut().zip(self.rhs.par_rows()).zip(self.image.par_rows());
        rows.enumerate().with_min_len(ROWS_AT_ONCE).for_each(|(y, ((solution, rhs), image))| {
            let diagonal = a.diagonal_row(y);
            let stride = diagonal.len();
            let channels = solution.chunks_mut(stride).zip(rhs.chunks(stride)).zip(image.chunks(stride));
            for ((solution, rhs), image) in channels {
                let inputs = rhs.iter().zip(image).zip(diagonal);
                for (u, ((r, q), d)) in solution.iter_mut().zip(inputs) {
                    *u += if *d > 0.0 { DAMPING / d * (r - q) } else { 0.0 };
                }
            }
        });
    }

    /// The residual of this level, summed over blocks: the right-hand side of the next.
    fn restrict(&mut self, a: &Stencil, next: &mut Self) {
        a.multiply::<C>(&self.solution, &mut self.image);
        let height = self.rhs.grid().height;
        let (rhs, image) = (&self.rhs, &self.image);
        let stride = next.rhs.grid().stride();
        next.rhs.par_rows_mut().enumerate().with_min_len(ROWS_AT_ONCE).for_each(|(y, out)| {
            out.fill(0.0);
            for (c, out) in out.chunks_mut(stride).enumerate() {
                for y in 2 * y..(2 * y + 2).min(height) {
                    for (x, (r, q)) in rhs.row(y, c).iter().zip(image.row(y, c)).enumerate() {
                        out[x / 2] += r - q;
                    }
                }
            }
        });
    }

    /// Adds the coarse solution to all coefficients of its blocks.
    fn correct(&mut self, coarse: &Planes) {
        let grid = self.solution.grid();
        let rows = self.solution.par_rows_mut().enumerate().with_min_len(ROWS_AT_ONCE);
        rows.for_each(|(y, row)| {
            for (c, row) in row.chunks_mut(grid.stride()).enumerate() {
                let coarse = coarse.row(y / 2, c);
                row[..grid.width].iter_mut().enumerate().for_each(|(x, u)| *u += CORRECTION * coarse[x / 2]);
            }
        });
    }
}
