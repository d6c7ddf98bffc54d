//! Regularised least squares with tensor products of B-splines: [`Fit`](super::Fit) in two dimensions.
//!
//! Given samples (x_s, y_s, f_s) anywhere in an image, minimise over the coefficients c_mn of
//! J(x, y) = sum_mn c_mn beta(x - m) beta(y - n)
//!
//! ```text
//! sum_s w_s (f_s - J(x_s, y_s))^2 + sum_pq g_pq (c_p - c_q)^2 + sum_pqr h_pqr (c_p - 2 c_q + c_r)^2
//! ```
//!
//! over neighbours pq and triples pqr in a row or column. The springs g and h differ from place to place:
//! across the edge of an object they are weak. For ORDER 2 the coefficients are the pixels. For ORDER 4 weak
//! springs of third differences are added at each sample, so that coefficients three apart are not coupled
//! (`rows::couplings`).
//!
//! Each equation has (ORDER + 1)^2 unknowns (and four more for h if ORDER is 2). A direct solution would
//! fill in, so conjugate gradients solve all channels together, from the mean of the samples around each
//! coefficient; a multigrid preconditioner takes over where holes are large.
//!
//! ```
//! use hybank_sampling::fit2::{Direction, Fit2, Fit2Sample, Iteration, Springs};
//! // Two samples of an image of 4 x 3 pixels, of two surfaces: no springs from column 1 to column 2.
//! let mut fit = Fit2::<2, 1>::new(4, 3);
//! fit.rows().add(&Fit2Sample { x: 0.0, y: 1.0, values: [10.0], weight: 1.0 });
//! fit.rows().add(&Fit2Sample { x: 3.0, y: 1.0, values: [20.0], weight: 1.0 });
//! let springs = |direction, row| match direction {
//!     Direction::Across => Springs { edge: vec![0.1, 0.0, 0.1, 0.0], ..Springs::none(4) },
//!     Direction::Down if row < 2 => Springs { edge: vec![0.1; 4], ..Springs::none(4) },
//!     Direction::Down => Springs::none(4),
//! };
//! let iteration = Iteration { tolerance: 1e-6, steps: 100 };
//! let (pixels, convergence) = fit.connect(springs, |_| false).solve(&iteration, &|_| ());
//! assert!(convergence.reached);
//! assert!(pixels.iter().zip([10.0, 10.0, 20.0, 20.0].iter().cycle()).all(|(a, b)| (a - b).abs() < 1e-3));
//! ```

mod conjugate;
mod multigrid;
mod planes;
mod rows;
mod springs;
mod stencil;

pub use rows::{Fit2Rows, Fit2Sample};
pub use springs::Springs;

use super::kernel::BSpline;
use planes::{Grid, Planes, ROWS_AT_ONCE};
use rayon::prelude::*;
use stencil::{Offset, Stencil, half_square};

/// When the conjugate gradients stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// Relative residual, in the norm of the inverse diagonal.
    pub tolerance: f64,
    /// Most steps.
    pub steps: usize,
}

/// How the conjugate gradients ended.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Steps taken, the most over the channels.
    pub steps: usize,
    /// Relative residual reached, the largest over the channels.
    pub residual: f64,
    /// Whether every channel reached the tolerance within the allowed steps.
    pub reached: bool,
}

/// Direction of neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Along a row.
    Across,
    /// Along a column.
    Down,
}

/// Accumulates samples into the normal equations of one image and solves them.
///
/// ORDER = degree + 1, 2 (bilinear) or 4 (bicubic); C values per sample.
#[derive(Debug, Clone)]
pub struct Fit2<const ORDER: usize, const C: usize> {
    size: (usize, usize),
    matrix: Stencil,
    rhs: Planes,
}

impl<const ORDER: usize, const C: usize> Fit2<ORDER, C> {
    /// An empty problem for an image of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        const { assert!(ORDER == 2 || ORDER == 4, "the fit of an image is bilinear or bicubic") }
        let grid = Grid::of_image::<ORDER>(width, height);
        let (matrix, rhs) = (Stencil::new(grid, offsets::<ORDER>()), Planes::zeros(grid, C));
        Self { size: (width, height), matrix, rhs }
    }

    /// Width and height of the grid of coefficients. It has ORDER / 2 - 1 coefficients more than pixels on
    /// each side.
    pub fn coefficients(&self) -> (usize, usize) {
        (self.matrix.grid().width, self.matrix.grid().height)
    }

    /// All rows, to add samples.
    pub fn rows(&mut self) -> Fit2Rows<'_, ORDER, C> {
        Fit2Rows::new(self.size, self.matrix.planes_mut().all_rows(), self.rhs.all_rows())
    }

    /// Weights of the samples at all coefficients, row by row: the sums of the rows of the normal equations
    /// without regularisation.
    pub fn weights(&self) -> Vec<f32> {
        let (width, stride) = (self.matrix.grid().width, self.matrix.grid().stride());
        let mut weights = vec![0.0; self.matrix.grid().len()];
        let rows = weights.par_chunks_mut(width.max(1)).enumerate().with_min_len(ROWS_AT_ONCE);
        rows.for_each_init(
            || vec![0.0; stride],
            |sums, (y, weights)| {
                self.matrix.row_sums(y, sums);
                weights.copy_from_slice(&sums[..width]);
            },
        );
        weights
    }

    /// Weighted values of the samples at a coefficient; their ratio to its weight is the mean of the samples
    /// around it.
    pub fn weighted_values(&self, coefficient: usize) -> [f32; C] {
        let (x, y) = (coefficient % self.matrix.grid().width, coefficient / self.matrix.grid().width);
        std::array::from_fn(|c| self.rhs.row(y, c)[x])
    }

    /// Adds springs to the equations. `springs` gives those of one direction that begin in one row of the
    /// grid of coefficients, and may be asked for a row more than once. Coefficients that are `alone`, with
    /// neither samples nor springs, are held at 0.
    pub fn connect(
        mut self,
        springs: impl Fn(Direction, usize) -> Springs + Sync,
        alone: impl Fn(usize) -> bool + Sync,
    ) -> Self {
        for direction in [Direction::Across, Direction::Down] {
            springs::add(&mut self.matrix, &springs, direction);
        }
        springs::hold(&mut self.matrix, alone);
        self
    }

    /// Solves the equations: J at the pixels, C values each, row by row. `watch` is called with the share of
    /// the way that is done, 0 to 1.
    pub fn solve(self, iteration: &Iteration, watch: &(dyn Fn(f64) + Sync)) -> (Vec<f32>, Convergence) {
        let (solution, convergence) = conjugate::solve::<C>(self.matrix, self.rhs, iteration, watch);
        (at_pixels::<ORDER, C>(&solution, self.size.0, self.size.1), convergence)
    }
}

/// Couplings of a matrix: those of samples first, as [`half_square`] has them, then those of triples.
fn offsets<const ORDER: usize>() -> Vec<Offset> {
    let mut offsets: Vec<Offset> = half_square(rows::reach(ORDER)).collect();
    let triples: Vec<Offset> = [(2, 0), (0, 2)].into_iter().filter(|o| !offsets.contains(o)).collect();
    offsets.extend(triples);
    offsets
}

/// J at the pixels.
fn at_pixels<const ORDER: usize, const C: usize>(
    coefficients: &Planes,
    width: usize,
    height: usize,
) -> Vec<f32> {
    let mut values = vec![0.0; width * height * C];
    let last = coefficients.grid().height.saturating_sub(1);
    // The last of the weights at a knot is 0.
    let weights = BSpline::<ORDER>::weights(0.0).1.map(|w| w as f32);
    let rows = values.par_chunks_mut(width.max(1) * C).enumerate().with_min_len(ROWS_AT_ONCE);
    rows.for_each(|(y, values)| {
        let values = values.as_chunks_mut::<C>().0;
        for c in 0..C {
            let rows: [&[f32]; ORDER] = std::array::from_fn(|j| coefficients.row((y + j).min(last), c));
            for (x, value) in values.iter_mut().enumerate() {
                let mut sum = 0.0;
                for (row, down) in rows.iter().zip(&weights[..ORDER - 1]) {
                    for (j, across) in weights[..ORDER - 1].iter().enumerate() {
                        sum += down * across * row[x + j];
                    }
                }
                value[c] = sum;
            }
        }
    });
    values
}

#[cfg(test)]
mod tests;
