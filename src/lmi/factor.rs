//! Cholesky factors of Newton matrices, which an interior-point method makes as ill-conditioned as the
//! machine precision allows.

use crate::linalg::{LinalgError, Mat, PositiveFactor};

/// A factored Newton matrix, scaled to a unit diagonal, shifted only as far as it had to be.
#[derive(Debug)]
pub(super) struct Shifted {
    matrix: Mat,
    scale: Vec<f64>,
    factor: PositiveFactor,
    /// The shift, relative to the unit diagonal.
    pub(super) shift: f64,
}

/// First shift tried when the matrix is not definite to rounding, and the growth of the next ones.
const SHIFT_FIRST: f64 = 1e-15;
const SHIFT_GROWTH: f64 = 10.0;
const SHIFT_LAST: f64 = 1e-6;
/// Steps of iterative refinement against the matrix as it is.
const REFINEMENTS: usize = 2;

impl Shifted {
    /// Factors the symmetric `matrix` given by its lower triangle.
    pub(super) fn new(mut matrix: Mat) -> Result<Self, LinalgError> {
        matrix.fill_upper_triangle_with_lower_triangle();
        let scale: Vec<f64> =
            matrix.diagonal().iter().map(|d| if *d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }).collect();
        for (j, mut column) in matrix.column_iter_mut().enumerate() {
            for (i, value) in column.iter_mut().enumerate() {
                *value *= scale[i] * scale[j];
            }
        }
        let mut shift = 0.0;
        loop {
            match PositiveFactor::new(&shifted(&matrix, shift)) {
                Ok(factor) => return Ok(Self { matrix, scale, factor, shift }),
                Err(error) if shift >= SHIFT_LAST => return Err(error),
                Err(_) => shift = (shift * SHIFT_GROWTH).max(SHIFT_FIRST),
            }
        }
    }

    /// Solves against the matrix as given, as far as the shift and refinement allow.
    pub(super) fn solve(&self, rhs: &[f64]) -> Vec<f64> {
        self.solve_many(&Mat::from_column_slice(rhs.len(), 1, rhs)).as_slice().to_vec()
    }

    /// `F^{-1} rhs` with the (shifted) matrix as `F F'`.
    pub(super) fn half(&self, rhs: &Mat) -> Mat {
        let scaled = Mat::from_fn(rhs.nrows(), rhs.ncols(), |i, j| rhs[(i, j)] * self.scale[i]);
        self.factor.solve_half(&scaled)
    }

    /// `F'^{-1} rhs`, the other half.
    pub(super) fn half_transposed(&self, rhs: &Mat) -> Mat {
        let mut x = self.factor.solve_half_transposed(rhs);
        x.row_iter_mut().zip(&self.scale).for_each(|(mut row, s)| row *= *s);
        x
    }

    fn solve_many(&self, rhs: &Mat) -> Mat {
        let scaled = Mat::from_fn(rhs.nrows(), rhs.ncols(), |i, j| rhs[(i, j)] * self.scale[i]);
        let mut x = self.factor.solve(&scaled);
        for _ in 0..REFINEMENTS {
            let residual = &scaled - &self.matrix * &x;
            let better = &x + self.factor.solve(&residual);
            if (&scaled - &self.matrix * &better).norm() >= residual.norm() {
                break;
            }
            x = better;
        }
        x.row_iter_mut().zip(&self.scale).for_each(|(mut row, s)| row *= *s);
        x
    }
}

fn shifted(matrix: &Mat, shift: f64) -> Mat {
    let mut m = matrix.clone();
    for i in 0..m.nrows() {
        m[(i, i)] += shift;
    }
    m
}
