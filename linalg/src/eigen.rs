//! Eigenvalues, singular values, and the decompositions that belong to them.

use super::{
    CMat, Complex, LinalgError, Mat, Scalar, Svd, balance, check_finite, no_convergence, owned, view,
};
use faer::Side;
use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use nalgebra::DMatrix;

/// Eigenvalues (ascending) and orthonormal eigenvectors (columns) of a symmetric matrix.
pub fn symmetric_eigen(m: &Mat) -> Result<(Vec<f64>, Mat), LinalgError> {
    check_finite("symmetric eigen", m)?;
    let e = view(m).self_adjoint_eigen(Side::Lower).map_err(|_| no_convergence("symmetric eigen", m))?;
    Ok((e.S().column_vector().iter().copied().collect(), owned(e.U())))
}

/// Eigenvalues of a symmetric or Hermitian matrix, ascending (lower triangle read).
pub fn hermitian_eigenvalues<T: Scalar>(m: &DMatrix<T>) -> Result<Vec<f64>, LinalgError> {
    check_finite("hermitian eigenvalues", m)?;
    T::hermitian_eigenvalues(m)
}

/// Eigenvalues of a general matrix, which is balanced first: units of the states and gains from one part to
/// another do not matter.
pub fn eigenvalues<T: Scalar>(m: &DMatrix<T>) -> Result<Vec<Complex<f64>>, LinalgError> {
    check_finite("eigenvalues", m)?;
    let mut values = Vec::with_capacity(m.nrows());
    for block in balance::balanced_blocks(m) {
        values.extend(T::eigenvalues(&block)?);
    }
    Ok(values)
}

/// Eigenvalues and eigenvectors (columns) of a general real matrix; the two of a conjugate pair are
/// neighbours.
pub fn eigen(m: &Mat) -> Result<(Vec<Complex<f64>>, CMat), LinalgError> {
    check_finite("eigen", m)?;
    if m.is_empty() {
        return Ok((Vec::new(), CMat::zeros(0, 0)));
    }
    let e = view(m).eigen().map_err(|_| no_convergence("eigen", m))?;
    Ok((e.S().column_vector().iter().copied().collect(), owned(e.U())))
}

/// Largest modulus of the eigenvalues of a square matrix.
pub fn spectral_radius(m: &Mat) -> Result<f64, LinalgError> {
    Ok(eigenvalues(m)?.iter().map(|z| z.norm()).fold(0.0, f64::max))
}

/// Thin singular value decomposition.
pub fn svd<T: Scalar>(m: &DMatrix<T>) -> Result<Svd<T>, LinalgError> {
    check_finite("svd", m)?;
    T::svd(m)
}

/// Singular values, descending.
pub fn singular_values<T: Scalar>(m: &DMatrix<T>) -> Result<Vec<f64>, LinalgError> {
    check_finite("singular values", m)?;
    T::singular_values(m)
}

/// Largest singular value of a complex matrix; 0 for an empty one. Up to rank two by the closed form, else
/// from the largest eigenvalue of the smaller Gram matrix, which squares all but loses digits of small ones
/// only: the relative error is a few eps, and it takes a third or less of the time of a decomposition.
pub fn largest_singular_value(m: &CMat) -> Result<f64, LinalgError> {
    check_finite("singular values", m)?;
    let scale = m.iter().map(|z| z.re.abs().max(z.im.abs())).fold(0.0, f64::max);
    if scale == 0.0 {
        return Ok(0.0);
    }
    let unit = m.unscale(scale);
    Ok(scale
        * match unit.shape() {
            (1, _) | (_, 1) => unit.norm(),
            (2, _) => largest_of_two(unit.row(0).iter(), unit.row(1).iter()),
            (_, 2) => largest_of_two(unit.column(0).iter(), unit.column(1).iter()),
            (rows, cols) if rows > cols => largest_by_gram(&unit.adjoint())?,
            _ => largest_by_gram(&unit)?,
        })
}

/// Root of the largest eigenvalue of m m*.
fn largest_by_gram(m: &CMat) -> Result<f64, LinalgError> {
    let mut gram = faer::Mat::zeros(m.nrows(), m.nrows());
    let rows = view(m);
    matmul(
        gram.as_mut(),
        BlockStructure::TriangularLower,
        faer::Accum::Replace,
        rows,
        BlockStructure::Rectangular,
        rows.adjoint(),
        BlockStructure::Rectangular,
        Complex::new(1.0, 0.0),
        faer::Par::Seq,
    );
    let values: Vec<f64> =
        gram.self_adjoint_eigenvalues(Side::Lower).map_err(|_| no_convergence("singular values", m))?;
    Ok(values.last().copied().unwrap_or(0.0).max(0.0).sqrt())
}

/// For two vectors u, v as rows or columns: `sigma^2 = (a + c) / 2 + hypot((a - c) / 2, |b|)` with
/// `a = |u|^2`, `c = |v|^2`, `b = <u, v>`.
fn largest_of_two<'a>(
    u: impl Iterator<Item = &'a Complex<f64>>,
    v: impl Iterator<Item = &'a Complex<f64>>,
) -> f64 {
    let start = (0.0, 0.0, Complex::ZERO);
    let (a, c, b) =
        u.zip(v).fold(start, |(a, c, b), (x, y)| (a + x.norm_sqr(), c + y.norm_sqr(), b + x.conj() * y));
    (0.5 * (a + c) + (0.5 * (a - c)).hypot(b.norm())).sqrt()
}
