#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod balance;
pub mod blocks;
mod eigen;
pub mod fourier;
pub mod least_squares;
mod scalar;
pub mod small;
mod solve;

pub use balance::{power_of_two, state_scales};
pub use eigen::{
    eigen, eigenvalues, hermitian_eigenvalues, largest_singular_value, singular_values, spectral_radius, svd,
    symmetric_eigen,
};
pub use scalar::{Scalar, Svd};
pub use solve::{PositiveFactor, cholesky, inverse, lq, lq_factor, solve, solve_lower, solve_positive};

use faer::MatRef;
pub use nalgebra::Complex;
use nalgebra::{ComplexField, DMatrix, DMatrixView, Dyn};

/// Real matrix of run-time size.
pub type Mat = DMatrix<f64>;
/// Complex matrix of run-time size.
pub type CMat = DMatrix<Complex<f64>>;

/// Eight-point Gauss-Legendre abscissae on [0, 1] and weights (Abramowitz & Stegun, table 25.4).
pub const GAUSS_LEGENDRE: [(f64, f64); 8] = [
    (0.019855071751231912, 0.05061426814518853),
    (0.10166676129318664, 0.11119051722668721),
    (0.2372337950418355, 0.15685332293894344),
    (0.4082826787521751, 0.18134189168918083),
    (0.5917173212478248, 0.18134189168918083),
    (0.7627662049581645, 0.15685332293894344),
    (0.8983332387068134, 0.11119051722668721),
    (0.9801449282487681, 0.05061426814518853),
];

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

/// Adds to row n of `sums` the inner products of the columns of `taps` with the `samples` from n on: those
/// of several filters, one in each column.
///
/// ```
/// use hybank_linalg::{Mat, add_filtered};
/// let mut sums = Mat::zeros(2, 1);
/// add_filtered(&mut sums, &[1.0, 2.0, 3.0], &Mat::from_row_slice(2, 1, &[10.0, 1.0]));
/// assert_eq!(sums.as_slice(), [12.0, 23.0]);
/// ```
///
/// # Panics
/// If `samples` has fewer than the rows of `sums` and `taps` together, less 1, or both have not as many
/// columns.
pub fn add_filtered(sums: &mut Mat, samples: &[f64], taps: &Mat) {
    let windows =
        DMatrixView::<f64, Dyn, Dyn>::from_slice_with_strides(samples, sums.nrows(), taps.nrows(), 1, 1);
    sums.gemm(1.0, &windows, taps, 1.0);
}

/// `[p_1 p_2 ..]`: the `parts` side by side. No parts give a 0 x 0 matrix.
///
/// # Panics
/// If the numbers of rows differ.
pub fn hstack<T: ComplexField>(parts: &[&DMatrix<T>]) -> DMatrix<T> {
    let rows = parts.first().map_or(0, |first| first.nrows());
    let mut whole = DMatrix::zeros(rows, parts.iter().map(|m| m.ncols()).sum());
    let mut start = 0;
    for part in parts {
        whole.columns_mut(start, part.ncols()).copy_from(part);
        start += part.ncols();
    }
    whole
}

/// `[p_1; p_2; ..]`: the `parts` on top of one another, the first one uppermost. No parts give a 0 x 0
/// matrix.
///
/// # Panics
/// If the numbers of columns differ.
pub fn vstack<T: ComplexField>(parts: &[&DMatrix<T>]) -> DMatrix<T> {
    let columns = parts.first().map_or(0, |first| first.ncols());
    let mut whole = DMatrix::zeros(parts.iter().map(|m| m.nrows()).sum(), columns);
    let mut start = 0;
    for part in parts {
        whole.rows_mut(start, part.nrows()).copy_from(part);
        start += part.nrows();
    }
    whole
}

/// The matrix of the given rows of blocks, `from_blocks(&[&[&a, &b], &[&c, &d]]) = [a b; c d]`.
///
/// # Panics
/// If the blocks of a row differ in their numbers of rows, or the rows in their widths.
pub fn from_blocks<T: ComplexField>(rows: &[&[&DMatrix<T>]]) -> DMatrix<T> {
    let rows: Vec<DMatrix<T>> = rows.iter().map(|row| hstack(row)).collect();
    vstack(&rows.iter().collect::<Vec<_>>())
}

/// `diag(p_1, p_2, ..)`: the `parts` along the diagonal, zeros elsewhere. Parts without rows or without
/// columns take up columns or rows only.
pub fn block_diagonal<T: ComplexField>(parts: &[&DMatrix<T>]) -> DMatrix<T> {
    let (rows, cols) = parts.iter().fold((0, 0), |(r, c), m| (r + m.nrows(), c + m.ncols()));
    let mut whole = DMatrix::zeros(rows, cols);
    let mut start = (0, 0);
    for part in parts {
        whole.view_mut(start, part.shape()).copy_from(part);
        start = (start.0 + part.nrows(), start.1 + part.ncols());
    }
    whole
}
