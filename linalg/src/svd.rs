//! Singular values.

use super::{CMat, Complex, LinalgError, Mat, check_finite, check_finite_c, no_convergence, owned, view};
use faer::Side;

/// Thin singular value decomposition `m = u diag(s) v'`, s descending.
#[derive(Debug, Clone)]
pub struct Svd {
    /// Left vectors, rows x k.
    pub u: Mat,
    /// Singular values, descending.
    pub s: Vec<f64>,
    /// Right vectors, cols x k.
    pub v: Mat,
}

/// Thin SVD of a real matrix.
pub fn svd(m: &Mat) -> Result<Svd, LinalgError> {
    check_finite("svd", m)?;
    let svd = view(m).thin_svd().map_err(|_| no_convergence("svd", m))?;
    let s = svd.S().column_vector().iter().copied().collect();
    Ok(Svd { u: owned(svd.U()), s, v: owned(svd.V()) })
}

/// Thin singular value decomposition `m = u diag(s) v*` of a complex matrix, s descending.
#[derive(Debug, Clone)]
pub struct SvdC {
    /// Left vectors, rows x k.
    pub u: CMat,
    /// Singular values, descending.
    pub s: Vec<f64>,
    /// Right vectors, cols x k.
    pub v: CMat,
}

/// Thin SVD of a complex matrix.
pub fn svd_c(m: &CMat) -> Result<SvdC, LinalgError> {
    check_finite_c("svd", m)?;
    let svd = view(m).thin_svd().map_err(|_| no_convergence("svd", m))?;
    let s = svd.S().column_vector().iter().map(|z| z.re).collect();
    Ok(SvdC { u: owned(svd.U()), s, v: owned(svd.V()) })
}

/// Singular values of a real matrix, descending.
pub fn singular_values(m: &Mat) -> Result<Vec<f64>, LinalgError> {
    check_finite("singular values", m)?;
    view(m).singular_values().map_err(|_| no_convergence("singular values", m))
}

/// Singular values of a complex matrix, descending.
pub fn singular_values_c(m: &CMat) -> Result<Vec<f64>, LinalgError> {
    check_finite_c("singular values", m)?;
    view(m).singular_values().map_err(|_| no_convergence("singular values", m))
}

/// Largest singular value of a complex matrix; 0 for an empty one. Up to rank two by the closed form, else
/// from the largest eigenvalue of the smaller Gram matrix, which squares all but loses digits of small ones
/// only: the relative error is a few eps, and it takes a third or less of the time of a decomposition.
pub fn largest_singular_value_c(m: &CMat) -> Result<f64, LinalgError> {
    check_finite_c("singular values", m)?;
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
    let m = view(m);
    faer::linalg::matmul::triangular::matmul(
        gram.as_mut(),
        faer::linalg::matmul::triangular::BlockStructure::TriangularLower,
        faer::Accum::Replace,
        m,
        faer::linalg::matmul::triangular::BlockStructure::Rectangular,
        m.adjoint(),
        faer::linalg::matmul::triangular::BlockStructure::Rectangular,
        Complex::new(1.0, 0.0),
        faer::Par::Seq,
    );
    let values: Vec<f64> = gram.self_adjoint_eigenvalues(Side::Lower).map_err(|_| {
        LinalgError::NoConvergence { routine: "singular values", rows: m.nrows(), cols: m.ncols() }
    })?;
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
