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

/// The solution of the finest level, and the levels below it.
pub(super) struct Multigrid<const C: usize> {
    solution: Planes,
    coarse: Vec<Level<C>>,
}

/// A level below the finest.
struct Level<const C: usize> {
    a: Stencil,
    rhs: Planes,
    solution: Planes,
}

impl<const C: usize> Level<C> {
    fn of(a: Stencil) -> Self {
        let zeros = || Planes::zeros(a.grid(), C);
        Self { rhs: zeros(), solution: zeros(), a }
    }
}

impl<const C: usize> Multigrid<C> {
    pub(super) fn new(finest: &Stencil) -> Self {
        let mut coarse: Vec<Level<C>> = Vec::new();
        loop {
            let last = coarse.last().map_or(finest, |level| &level.a);
            if last.grid().len() <= COARSEST {
                break;
            }
            let next = Level::of(last.coarsened());
            coarse.push(next);
        }
        Self { solution: Planes::zeros(finest.grid(), C), coarse }
    }

    /// M^{-1} residual: one symmetric V-cycle. `scratch` has the size of the residual.
    pub(super) fn apply(&mut self, finest: &Stencil, residual: &Planes, scratch: &mut Planes) -> &Planes {
        Step::<C> { a: finest, rhs: residual, solution: &mut self.solution }.cycle(&mut self.coarse, scratch);
        &self.solution
    }
}

/// The equations of one level and their solution so far. `image` in its methods is work memory.
struct Step<'a, const C: usize> {
    a: &'a Stencil,
    rhs: &'a Planes,
    solution: &'a mut Planes,
}

impl<const C: usize> Step<'_, C> {
    fn cycle(&mut self, coarse: &mut [Level<C>], image: &mut Planes) {
        image.reshape(self.a.grid());
        self.start();
        let Some((next, rest)) = coarse.split_first_mut() else {
            (1..COARSEST_STEPS).for_each(|_| self.smooth(image));
            return;
        };
        self.restrict(image, &mut next.rhs);
        Step::<C> { a: &next.a, rhs: &next.rhs, solution: &mut next.solution }.cycle(rest, image);
        image.reshape(self.a.grid());
        self.correct(&next.solution);
        self.smooth(image);
    }

    /// The Jacobi step from 0: solution = DAMPING D^{-1} rhs.
    fn start(&mut self) {
        let a = self.a;
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
    fn smooth(&mut self, image: &mut Planes) {
        let a = self.a;
        a.multiply::<C>(self.solution, image);
        let rows = self.solution.par_rows_mut().zip(self.rhs.par_rows()).zip(image.par_rows());
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
    fn restrict(&self, image: &mut Planes, next: &mut Planes) {
        self.a.multiply::<C>(self.solution, image);
        let (height, rhs, image) = (self.rhs.grid().height, self.rhs, &*image);
        let stride = next.grid().stride();
        next.par_rows_mut().enumerate().with_min_len(ROWS_AT_ONCE).for_each(|(y, out)| {
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
