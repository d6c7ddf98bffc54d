//! Linear systems and products without copies.

use super::{CMat, Mat, owned, view};
use faer::linalg::solvers::{DenseSolveCore, Solve};

/// Solves the square system `m x = rhs` by LU with partial pivoting. A singular `m` gives infinities or
/// NaN, for which the caller must check.
pub fn solve(m: &Mat, rhs: &Mat) -> Mat {
    owned(view(m).partial_piv_lu().solve(view(rhs)).as_ref())
}

/// Complex counterpart of [`solve`].
pub fn solve_c(m: &CMat, rhs: &CMat) -> CMat {
    owned(view(m).partial_piv_lu().solve(view(rhs)).as_ref())
}

/// Inverse by LU with partial pivoting; see [`solve`] for singular matrices.
pub fn inverse(m: &Mat) -> Mat {
    owned(view(m).partial_piv_lu().inverse().as_ref())
}

/// Solves `l x = rhs` with a lower triangular `l`.
pub fn solve_lower(l: &Mat, rhs: &Mat) -> Mat {
    let mut x = faer::Mat::from_fn(rhs.nrows(), rhs.ncols(), |i, j| rhs[(i, j)]);
    view(l).solve_lower_triangular_in_place(x.as_mut());
    owned(x.as_ref())
}

/// Solves `l' x = rhs` with a lower triangular `l`.
pub fn solve_lower_transposed(l: &Mat, rhs: &Mat) -> Mat {
    let mut x = faer::Mat::from_fn(rhs.nrows(), rhs.ncols(), |i, j| rhs[(i, j)]);
    view(l).transpose().solve_upper_triangular_in_place(x.as_mut());
    owned(x.as_ref())
}

/// `a[:, columns]' b` without copying the transpose.
///
/// # Panics
/// If the columns are not columns of `a` or the numbers of rows differ.
pub fn transposed_product(a: &Mat, columns: std::ops::Range<usize>, b: &Mat) -> Mat {
    let part = view(a).subcols(columns.start, columns.len());
    owned((part.transpose() * view(b)).as_ref())
}
