#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod assemble;
mod balance;
pub mod blocks;
mod eigen;
pub mod fourier;
pub mod least_squares;
mod scalar;
mod solve;

pub use assemble::{block_diagonal, from_blocks, hstack, vstack};
pub use balance::{power_of_two, state_scales};
pub use eigen::{
    candidate_eigenvalues, eigen, eigenvalues, hermitian_eigenvalues, largest_singular_value, real_schur,
    singular_values, spectral_radius, svd, symmetric_eigen,
};
pub use scalar::{Scalar, Svd};
pub use solve::{PositiveFactor, cholesky, inverse, lq, lq_factor, solve, solve_lower, solve_positive};

use faer::MatRef;
pub use nalgebra::Complex;
use nalgebra::DMatrix;

/// Real matrix of run-time size.
pub type Mat = DMatrix<f64>;
/// Complex matrix of run-time size.
pub type CMat = DMatrix<Complex<f64>>;

/// Why a decomposition failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinalgError {
    /// A Cholesky factorisation met a pivot that is not positive.
    #[error("the matrix is not positive definite (pivot {pivot})")]
    NotPositiveDefinite {
        /// Index of the failing pivot, from 0.
        pivot: usize,
    },
    /// An iterative eigenvalue or singular value routine did not converge.
    #[error("the {routine} iteration did not converge on a {rows} x {cols} matrix")]
    NoConvergence {
        /// Name of the routine.
        routine: &'static str,
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        cols: usize,
    },
    /// A matrix holds NaN or infinity.
    #[error("the {rows} x {cols} matrix given to {routine} holds a value that is not finite")]
    NotFinite {
        /// Name of the routine.
        routine: &'static str,
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        cols: usize,
    },
}

fn view<T>(m: &DMatrix<T>) -> MatRef<'_, T> {
    MatRef::from_column_major_slice(m.as_slice(), m.nrows(), m.ncols())
}

fn owned<T: Copy + nalgebra::Scalar>(m: MatRef<'_, T>) -> DMatrix<T> {
    DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)])
}

fn no_convergence<T>(routine: &'static str, m: &DMatrix<T>) -> LinalgError {
    LinalgError::NoConvergence { routine, rows: m.nrows(), cols: m.ncols() }
}

/// Refuses NaN and infinity before an iteration that might never end on them.
fn check_finite<T: Scalar>(routine: &'static str, m: &DMatrix<T>) -> Result<(), LinalgError> {
    if m.iter().all(nalgebra::ComplexField::is_finite) {
        return Ok(());
    }
    Err(LinalgError::NotFinite { routine, rows: m.nrows(), cols: m.ncols() })
}

/// (m + m') / 2.
pub fn symmetric_part(m: &Mat) -> Mat {
    (m + m.transpose()) * 0.5
}

/// `e^m` by nalgebra's scaling and squaring with Padé approximants.
pub fn expm(m: &Mat) -> Mat {
    if m.is_empty() { m.clone() } else { m.exp() }
}

/// A real matrix as a complex one.
pub fn to_complex(m: &Mat) -> CMat {
    m.map(|x| Complex::new(x, 0.0))
}

/// `x' y` of rows of equal length. Eight partial sums let the compiler use vector instructions.
///
/// # Panics
/// If the lengths differ.
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    assert_eq!(x.len(), y.len(), "the factors of an inner product have one length");
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks::<8>(), y.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (x, y) in x.iter().zip(y) {
        // No `array::from_fn`, which is a call for each entry below the highest level of optimisation.
        sums.iter_mut().zip(x.iter().zip(y)).for_each(|(sum, (x, y))| *sum += x * y);
    }
    sums.iter_mut().zip(x_rest.iter().zip(y_rest)).for_each(|(sum, (x, y))| *sum += x * y);
    sums.iter().sum()
}
