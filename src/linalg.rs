//! The one place that knows which crate does which decomposition.
//!
//! Matrices are nalgebra's [`DMatrix`]; every decomposition of run-time size is faer's, because
//! nalgebra's SVD is wrong on rank-deficient matrices and its Schur form may never end on delay
//! lines. The two share memory (both are column-major), so nothing is copied on the way in.
//! Everything here is sequential and therefore gives the same bits on every run.

mod balance;
pub mod blocks;

pub use balance::power_of_two;

use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{MatRef, Side};
pub use nalgebra::Complex;
use nalgebra::DMatrix;

/// Real matrix of run-time size.
pub type Mat = DMatrix<f64>;
/// Complex matrix of run-time size.
pub type CMat = DMatrix<Complex<f64>>;

/// Why a decomposition could not be had.
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

/// Lower trapezoidal `L` (rows x min(rows, cols)) with `L L' = m m'`, by a QR factorisation of `m'`:
/// a square root is compressed without ever being squared.
pub fn lq_factor(m: &Mat) -> Mat {
    if m.is_empty() {
        return Mat::zeros(m.nrows(), m.nrows().min(m.ncols()));
    }
    let qr = view(m).transpose().qr();
    owned(qr.thin_R()).transpose()
}

/// Thin `(L, Q)` with `m = L Q`, `Q Q' = I`.
pub fn lq(m: &Mat) -> (Mat, Mat) {
    if m.is_empty() {
        let k = m.nrows().min(m.ncols());
        return (Mat::zeros(m.nrows(), k), Mat::zeros(k, m.ncols()));
    }
    let qr = view(m).transpose().qr();
    (owned(qr.thin_R()).transpose(), owned(qr.compute_thin_Q().as_ref()).transpose())
}

/// Complex counterpart of [`lq_factor`]: `L L* = m m*`.
pub fn lq_factor_c(m: &CMat) -> CMat {
    if m.is_empty() {
        return CMat::zeros(m.nrows(), m.nrows().min(m.ncols()));
    }
    let qr = view(&m.adjoint()).qr();
    owned(qr.thin_R()).adjoint()
}

/// Complex counterpart of [`lq`]: thin `(L, Q)` with `m = L Q`, `Q Q* = I`.
pub fn lq_c(m: &CMat) -> (CMat, CMat) {
    if m.is_empty() {
        let k = m.nrows().min(m.ncols());
        return (CMat::zeros(m.nrows(), k), CMat::zeros(k, m.ncols()));
    }
    let qr = view(&m.adjoint()).qr();
    (owned(qr.thin_R()).adjoint(), owned(qr.compute_thin_Q().as_ref()).adjoint())
}

/// Lower Cholesky factor of a symmetric matrix; only the lower triangle is read.
pub fn cholesky(m: &Mat) -> Result<Mat, LinalgError> {
    match view(m).llt(Side::Lower) {
        Ok(llt) => Ok(owned(llt.L())),
        Err(faer::linalg::solvers::LltError::NonPositivePivot { index }) => {
            Err(LinalgError::NotPositiveDefinite { pivot: index })
        }
    }
}

/// Solves `m x = rhs` for a symmetric positive definite `m` (lower triangle read).
pub fn solve_positive(m: &Mat, rhs: &Mat) -> Result<Mat, LinalgError> {
    match view(m).llt(Side::Lower) {
        Ok(llt) => Ok(owned(llt.solve(view(rhs)).as_ref())),
        Err(faer::linalg::solvers::LltError::NonPositivePivot { index }) => {
            Err(LinalgError::NotPositiveDefinite { pivot: index })
        }
    }
}

/// Cholesky factorisation of a symmetric positive definite matrix, kept for many right-hand sides.
#[derive(Debug, Clone)]
pub struct PositiveFactor {
    llt: faer::linalg::solvers::Llt<f64>,
}

impl PositiveFactor {
    /// Factors `m`; only the lower triangle is read.
    pub fn new(m: &Mat) -> Result<Self, LinalgError> {
        match view(m).llt(Side::Lower) {
            Ok(llt) => Ok(Self { llt }),
            Err(faer::linalg::solvers::LltError::NonPositivePivot { index }) => {
                Err(LinalgError::NotPositiveDefinite { pivot: index })
            }
        }
    }

    /// `m^{-1} rhs`.
    pub fn solve(&self, rhs: &Mat) -> Mat {
        owned(self.llt.solve(view(rhs)).as_ref())
    }

    /// `L^{-1} rhs` with the lower factor L, `m = L L'`.
    pub fn solve_half(&self, rhs: &Mat) -> Mat {
        let mut x = faer::Mat::from_fn(rhs.nrows(), rhs.ncols(), |i, j| rhs[(i, j)]);
        self.llt.L().solve_lower_triangular_in_place(x.as_mut());
        owned(x.as_ref())
    }

    /// `L'^{-1} rhs`, the other half.
    pub fn solve_half_transposed(&self, rhs: &Mat) -> Mat {
        let mut x = faer::Mat::from_fn(rhs.nrows(), rhs.ncols(), |i, j| rhs[(i, j)]);
        self.llt.L().transpose().solve_upper_triangular_in_place(x.as_mut());
        owned(x.as_ref())
    }
}

/// `a[:, columns]' b` without copying the transpose.
///
/// # Panics
/// If the columns are not columns of `a` or the numbers of rows differ.
pub fn transposed_product(a: &Mat, columns: std::ops::Range<usize>, b: &Mat) -> Mat {
    let part = view(a).subcols(columns.start, columns.len());
    owned((part.transpose() * view(b)).as_ref())
}

/// Solves the square system `m x = rhs` by LU with partial pivoting. A singular `m` gives
/// infinities or NaN, which the caller has to look for.
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

/// Largest singular value of a complex matrix; 0 for an empty one. Up to rank two by the closed form, else from the largest
/// eigenvalue of the smaller Gram matrix, which squares all but loses digits of small ones only: the relative error is a few eps, and
/// it takes a third or less of the time of a decomposition.
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

/// For two vectors u, v as rows or columns: `sigma^2 = (a + c) / 2 + hypot((a - c) / 2, |b|)` with `a = |u|^2`,
/// `c = |v|^2`, `b = <u, v>`.
fn largest_of_two<'a>(
    u: impl Iterator<Item = &'a Complex<f64>>,
    v: impl Iterator<Item = &'a Complex<f64>>,
) -> f64 {
    let start = (0.0, 0.0, Complex::ZERO);
    let (a, c, b) =
        u.zip(v).fold(start, |(a, c, b), (x, y)| (a + x.norm_sqr(), c + y.norm_sqr(), b + x.conj() * y));
    (0.5 * (a + c) + (0.5 * (a - c)).hypot(b.norm())).sqrt()
}

/// Eigenvalues (ascending) and orthonormal eigenvectors (columns) of a symmetric matrix.
pub fn symmetric_eigen(m: &Mat) -> Result<(Vec<f64>, Mat), LinalgError> {
    check_finite("symmetric eigen", m)?;
    let e = view(m).self_adjoint_eigen(Side::Lower).map_err(|_| no_convergence("symmetric eigen", m))?;
    Ok((e.S().column_vector().iter().copied().collect(), owned(e.U())))
}

/// Eigenvalues of a symmetric matrix, ascending (lower triangle read).
pub fn symmetric_eigenvalues(m: &Mat) -> Result<Vec<f64>, LinalgError> {
    check_finite("symmetric eigenvalues", m)?;
    view(m).self_adjoint_eigenvalues(Side::Lower).map_err(|_| no_convergence("symmetric eigenvalues", m))
}

/// Eigenvalues of a Hermitian matrix, ascending (lower triangle read).
pub fn hermitian_eigenvalues(m: &CMat) -> Result<Vec<f64>, LinalgError> {
    check_finite_c("hermitian eigenvalues", m)?;
    view(m).self_adjoint_eigenvalues(Side::Lower).map_err(|_| no_convergence("hermitian eigenvalues", m))
}

/// Eigenvalues of a general real matrix, which is balanced first: units of the states and gains from one part to
/// another do not matter.
pub fn eigenvalues(m: &Mat) -> Result<Vec<Complex<f64>>, LinalgError> {
    check_finite("eigenvalues", m)?;
    balanced_eigenvalues(m, raw_eigenvalues).map(|(values, _)| values)
}

/// Eigenvalues of a general complex matrix, balanced first.
pub fn eigenvalues_c(m: &CMat) -> Result<Vec<Complex<f64>>, LinalgError> {
    check_finite_c("eigenvalues", m)?;
    balanced_eigenvalues(m, raw_eigenvalues_c).map(|(values, _)| values)
}

/// Powers of two by which to divide the states of x+ = a x + b u, y = c x, so that what drives a state and what it drives are
/// alike. Of b and c only the proportions count: their sizes change with the units of u and y, which are not to distort a.
pub fn state_scales(a: &Mat, b: &Mat, c: &Mat) -> Vec<f64> {
    let n = a.nrows();
    let share = |part: f64, whole: f64| if part > 0.0 { part / whole } else { 0.0 };
    let (all_in, all_out) = (b.norm(), c.norm());
    // All inputs are one state that drives, all outputs one that is driven.
    let mut joint = Mat::zeros(n + 2, n + 2);
    joint.view_mut((0, 0), (n, n)).copy_from(&a.abs());
    for i in 0..n {
        joint[(i, n)] = share(b.row(i).norm(), all_in);
        joint[(n + 1, i)] = share(c.column(i).norm(), all_out);
    }
    let mut scales = balance::scales(joint);
    scales.truncate(n);
    scales
}

/// Scales that differ by more than this may do harm: a change of coordinates magnifies errors by up to its condition, here to
/// 2e-10. Eigenvalues that all but meet move by the square root of that.
const SAFE_CONDITION: f64 = 1e6;

/// Candidates for the eigenvalues of a general real matrix, where a false one does no harm and a missed one does: those of
/// [`eigenvalues`] and, where balancing changed scales by many decades, those of the matrix as it stands beside them.
pub fn candidate_eigenvalues(m: &Mat) -> Result<Vec<Complex<f64>>, LinalgError> {
    check_finite("eigenvalues", m)?;
    both_ways(m, raw_eigenvalues)
}

/// As [`candidate_eigenvalues`], complex.
pub fn candidate_eigenvalues_c(m: &CMat) -> Result<Vec<Complex<f64>>, LinalgError> {
    check_finite_c("eigenvalues", m)?;
    both_ways(m, raw_eigenvalues_c)
}

type Eigenvalues<T> = fn(&DMatrix<T>) -> Result<Vec<Complex<f64>>, LinalgError>;

fn raw_eigenvalues(m: &Mat) -> Result<Vec<Complex<f64>>, LinalgError> {
    if m.is_empty() {
        Ok(Vec::new())
    } else {
        view(m).eigenvalues().map_err(|_| no_convergence("eigenvalues", m))
    }
}

fn raw_eigenvalues_c(m: &CMat) -> Result<Vec<Complex<f64>>, LinalgError> {
    if m.is_empty() {
        Ok(Vec::new())
    } else {
        view(m).eigenvalues().map_err(|_| no_convergence("eigenvalues", m))
    }
}

fn both_ways<T: nalgebra::ComplexField<RealField = f64>>(
    m: &DMatrix<T>,
    raw: Eigenvalues<T>,
) -> Result<Vec<Complex<f64>>, LinalgError> {
    let (mut values, condition) = balanced_eigenvalues(m, raw)?;
    if condition > SAFE_CONDITION {
        values.extend(raw(m)?);
    }
    Ok(values)
}

/// The eigenvalues of the balanced blocks of `m`, with the condition of the worst scaling.
fn balanced_eigenvalues<T: nalgebra::ComplexField<RealField = f64>>(
    m: &DMatrix<T>,
    raw: Eigenvalues<T>,
) -> Result<(Vec<Complex<f64>>, f64), LinalgError> {
    let (mut values, mut condition) = (Vec::with_capacity(m.nrows()), 1.0f64);
    for block in balance::balanced_blocks(m) {
        values.extend(raw(&block.matrix)?);
        condition = condition.max(block.condition);
    }
    Ok((values, condition))
}

/// Eigenvalues and eigenvectors (columns) of a general real matrix; the two of a conjugate pair are neighbours.
pub fn eigen(m: &Mat) -> Result<(Vec<Complex<f64>>, CMat), LinalgError> {
    check_finite("eigen", m)?;
    if m.is_empty() {
        return Ok((Vec::new(), CMat::zeros(0, 0)));
    }
    let e = view(m).eigen().map_err(|_| no_convergence("eigen", m))?;
    Ok((e.S().column_vector().iter().copied().collect(), owned(e.U())))
}

/// Rotations a row after which a Schur iteration is given up; one or two are usual.
const SCHUR_SWEEPS: usize = 100;

/// Real Schur form `m = q t q'`: q orthogonal, t zero below its diagonal but for 2 x 2 blocks.
///
/// faer keeps its own private, so this one is nalgebra's, with a bound: it never ends on some delay lines.
pub fn real_schur(m: &Mat) -> Result<(Mat, Mat), LinalgError> {
    check_finite("Schur", m)?;
    let n = m.nrows();
    if n < 2 {
        return Ok((Mat::identity(n, n), m.clone()));
    }
    let schur = nalgebra::linalg::Schur::try_new(m.clone(), f64::EPSILON, SCHUR_SWEEPS * n)
        .ok_or_else(|| no_convergence("Schur", m))?;
    let (q, mut t) = schur.unpack();
    for j in 0..n {
        for i in j + 1..n {
            let negligible = t[(i, j)].abs() <= f64::EPSILON * (t[(j, j)].abs() + t[(i, i)].abs());
            if i > j + 1 || negligible {
                t[(i, j)] = 0.0;
            }
        }
    }
    Ok((q, t))
}

/// Largest modulus of the eigenvalues of a square matrix.
pub fn spectral_radius(m: &Mat) -> Result<f64, LinalgError> {
    Ok(eigenvalues(m)?.iter().map(|z| z.norm()).fold(0.0, f64::max))
}

/// `e^m` by nalgebra's scaling and squaring with Padé approximants.
pub fn expm(m: &Mat) -> Mat {
    if m.is_empty() { m.clone() } else { m.exp() }
}

/// A real matrix as a complex one.
pub fn to_complex(m: &Mat) -> CMat {
    m.map(|x| Complex::new(x, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delay_line(n: usize) -> Mat {
        Mat::from_fn(n, n, |i, j| f64::from(u8::from(i == j + 1)))
    }

    #[test]
    fn svd_is_right_on_rank_one_matrices() {
        for n in 2..16 {
            let m = Mat::from_element(n, n, 1.0);
            let svd = svd(&m).unwrap();
            let back = &svd.u * Mat::from_diagonal(&svd.s.clone().into()) * svd.v.transpose();
            assert!((svd.s[0] - n as f64).abs() < 1e-12, "n = {n}, sigma = {}", svd.s[0]);
            assert!((back - m).norm() < 1e-12);
        }
    }

    #[test]
    fn eigenvalues_end_on_delay_lines_and_cyclic_shifts() {
        for n in 2..17 {
            assert!(spectral_radius(&delay_line(n)).unwrap() < 1e-12);
            let mut cyclic = delay_line(n);
            cyclic[(0, n - 1)] = 1.0;
            for z in eigenvalues(&cyclic).unwrap() {
                assert!((z.norm() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn lq_factor_keeps_the_product_and_the_small_rows() {
        let m = Mat::from_fn(4, 9, |i, j| 1e-9_f64.powi(i as i32) * ((i * 7 + j * 3) as f64).sin());
        let l = lq_factor(&m);
        assert_eq!(l.shape(), (4, 4));
        for i in 0..4 {
            let (a, b) = (l.row(i).norm(), m.row(i).norm());
            assert!((a - b).abs() < 1e-13 * b, "row {i}: {a} {b}");
        }
    }

    #[test]
    fn cholesky_names_the_failing_pivot() {
        let m = Mat::from_diagonal(&nalgebra::dvector![1.0, 2.0, -1.0]);
        assert_eq!(cholesky(&m), Err(LinalgError::NotPositiveDefinite { pivot: 2 }));
    }

    const SHAPES: [(usize, usize); 13] = [
        (0, 3),
        (1, 1),
        (1, 5),
        (4, 1),
        (2, 2),
        (2, 6),
        (5, 2),
        (3, 3),
        (4, 7),
        (7, 3),
        (8, 35),
        (35, 8),
        (12, 12),
    ];

    #[test]
    fn the_largest_of_equal_singular_values_is_one_of_them() {
        for n in 1..16 {
            let turned = CMat::from_fn(n, n, |i, j| {
                Complex::from_polar(
                    (n as f64).sqrt().recip(),
                    (i * j) as f64 * std::f64::consts::TAU / n as f64,
                )
            });
            assert!((largest_singular_value_c(&turned).unwrap() - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn largest_singular_value_agrees_with_the_decomposition() {
        for (rows, cols) in SHAPES {
            for (seed, scale) in [(1.0, 1.0), (2.0, 1e-100), (3.0, 1e100), (4.0, 0.0)] {
                let entry = |i: usize, j: usize| {
                    let x = seed + (3 * i + 7 * j) as f64;
                    Complex::new(scale * x.sin(), scale * (1.7 * x).cos())
                };
                let m = CMat::from_fn(rows, cols, entry);
                let want = if rows == 0 { 0.0 } else { singular_values_c(&m).unwrap()[0] };
                let got = largest_singular_value_c(&m).unwrap();
                assert!((got - want).abs() <= 1e-14 * want, "{rows} x {cols} at {scale}: {got} {want}");
            }
        }
    }

    #[test]
    fn a_not_finite_matrix_has_no_largest_singular_value() {
        for n in [1, 2, 3] {
            let m = CMat::from_element(n, n, Complex::new(f64::NAN, 0.0));
            assert!(matches!(largest_singular_value_c(&m), Err(LinalgError::NotFinite { .. })));
        }
    }

    #[test]
    fn non_finite_input_is_refused() {
        let m = Mat::from_element(3, 3, f64::NAN);
        assert!(matches!(eigenvalues(&m), Err(LinalgError::NotFinite { .. })));
        assert!(matches!(svd(&m), Err(LinalgError::NotFinite { .. })));
    }
}
