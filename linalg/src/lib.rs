//! Matrix decompositions and Fourier transforms: one interface to nalgebra, faer and the FFT crates.
//!
//! Matrices are nalgebra's [`DMatrix`]; every decomposition of run-time size is faer's, because nalgebra's
//! SVD is wrong on rank-deficient matrices and its Schur form may never end on delay lines. Both libraries
//! store matrices column-major, so faer reads nalgebra's memory without a copy. Everything here is
//! sequential and therefore gives the same bits on every run.
//!
//! It is a separate crate to save compile time: the generic code of these libraries is compiled here once,
//! and not again with every change of the crates that use it.

#![forbid(unsafe_code)]

mod assemble;
mod balance;
pub mod blocks;
mod cholesky;
mod eigen;
pub mod fourier;
pub mod least_squares;
mod lq;
mod solve;
mod svd;

pub use assemble::{block_diagonal, from_blocks, hstack, vstack};
pub use balance::{power_of_two, state_scales};
pub use cholesky::{PositiveFactor, cholesky, solve_positive};
pub use eigen::{
    candidate_eigenvalues, candidate_eigenvalues_c, eigen, eigenvalues, eigenvalues_c, hermitian_eigenvalues,
    real_schur, spectral_radius, symmetric_eigen, symmetric_eigenvalues,
};
pub use lq::{lq, lq_c, lq_factor, lq_factor_c};
pub use solve::{inverse, solve, solve_c, solve_lower, solve_lower_transposed, transposed_product};
pub use svd::{Svd, SvdC, largest_singular_value_c, singular_values, singular_values_c, svd, svd_c};

use faer::MatRef;
pub use nalgebra::Complex;
use nalgebra::DMatrix;

/// Real matrix of run-time size.
pub type Mat = DMatrix<f64>;
/// Complex matrix of run-time size.
pub type CMat = DMatrix<Complex<f64>>;

/// Why a decomposition failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
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
    /// The sizes of the matrices do not match.
    #[error("{operation} needs as many {shared} in each matrix, got {}x{} and {}x{}", first.0, first.1, other.0, other.1)]
    Sizes {
        /// The operation.
        operation: &'static str,
        /// The size that must be equal: rows or columns.
        shared: &'static str,
        /// Rows and columns of the first matrix.
        first: (usize, usize),
        /// Rows and columns of the one that does not fit it.
        other: (usize, usize),
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
fn check_finite(routine: &'static str, m: &Mat) -> Result<(), LinalgError> {
    if m.iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(LinalgError::NotFinite { routine, rows: m.nrows(), cols: m.ncols() })
}

fn check_finite_c(routine: &'static str, m: &CMat) -> Result<(), LinalgError> {
    if m.iter().all(|x| x.re.is_finite() && x.im.is_finite()) {
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
