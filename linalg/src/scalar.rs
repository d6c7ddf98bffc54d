//! Decompositions of real and of complex matrices, written once.
//!
//! A generic function is compiled where it is called, so the crates above would compile faer again with
//! every change. The methods of [`Scalar`] are not generic: they are compiled here, for both kinds of
//! numbers.

use super::{LinalgError, no_convergence, owned, view};
use crate::Complex;
use faer::Side;
use faer::linalg::solvers::Solve;
use nalgebra::{ComplexField, DMatrix};

/// Thin singular value decomposition `m = u diag(s) v*`, s descending.
///
/// ```
/// use hybank_linalg::{Mat, svd};
/// let m = Mat::from_row_slice(2, 3, &[0.0, 0.0, 2.0, 1.0, 0.0, 0.0]);
/// let found = svd(&m)?;
/// assert!((found.s[0] - 2.0).abs() < 1e-15 && (found.s[1] - 1.0).abs() < 1e-15);
/// assert_eq!((found.rank(1e-12), found.rank(0.6)), (2, 1));
/// let scaled = &found.u * Mat::from_diagonal(&found.s.clone().into());
/// assert!((scaled * found.v.transpose() - m).norm() < 1e-15);
/// # Ok::<(), hybank_linalg::LinalgError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Svd<T: Scalar = f64> {
    /// Left vectors, rows x k.
    pub u: DMatrix<T>,
    /// Singular values, descending.
    pub s: Vec<f64>,
    /// Right vectors, cols x k.
    pub v: DMatrix<T>,
}

impl<T: Scalar> Svd<T> {
    /// How many singular values exceed the share `cut` of the largest.
    pub fn rank(&self, cut: f64) -> usize {
        let floor = cut * self.s.first().copied().unwrap_or(0.0);
        self.s.iter().filter(|s| **s > floor).count()
    }
}

/// A real or complex number in double precision. The methods take finite matrices that are not empty; the
/// functions of the crate that bear their names check that.
#[doc(hidden)]
pub trait Scalar: ComplexField<RealField = f64> + Copy {
    fn svd(m: &DMatrix<Self>) -> Result<Svd<Self>, LinalgError>;
    fn singular_values(m: &DMatrix<Self>) -> Result<Vec<f64>, LinalgError>;
    fn hermitian_eigenvalues(m: &DMatrix<Self>) -> Result<Vec<f64>, LinalgError>;
    fn eigenvalues(m: &DMatrix<Self>) -> Result<Vec<Complex<f64>>, LinalgError>;
    fn lq(m: &DMatrix<Self>) -> (DMatrix<Self>, DMatrix<Self>);
    fn lq_factor(m: &DMatrix<Self>) -> DMatrix<Self>;
    fn solve(m: &DMatrix<Self>, rhs: &DMatrix<Self>) -> DMatrix<Self>;
}

macro_rules! decompositions {
    ($number:ty) => {
        impl Scalar for $number {
            fn svd(m: &DMatrix<Self>) -> Result<Svd<Self>, LinalgError> {
                let svd = view(m).thin_svd().map_err(|_| no_convergence("svd", m))?;
                let s = svd.S().column_vector().iter().map(|value| value.real()).collect();
                Ok(Svd { u: owned(svd.U()), s, v: owned(svd.V()) })
            }

            fn singular_values(m: &DMatrix<Self>) -> Result<Vec<f64>, LinalgError> {
                view(m).singular_values().map_err(|_| no_convergence("singular values", m))
            }

            fn hermitian_eigenvalues(m: &DMatrix<Self>) -> Result<Vec<f64>, LinalgError> {
                let values = view(m).self_adjoint_eigenvalues(Side::Lower);
                values.map_err(|_| no_convergence("hermitian eigenvalues", m))
            }

            fn eigenvalues(m: &DMatrix<Self>) -> Result<Vec<Complex<f64>>, LinalgError> {
                view(m).eigenvalues().map_err(|_| no_convergence("eigenvalues", m))
            }

            fn lq(m: &DMatrix<Self>) -> (DMatrix<Self>, DMatrix<Self>) {
                let qr = view(&m.adjoint()).qr();
                (owned(qr.thin_R()).adjoint(), owned(qr.compute_thin_Q().as_ref()).adjoint())
            }

            fn lq_factor(m: &DMatrix<Self>) -> DMatrix<Self> {
                owned(view(&m.adjoint()).qr().thin_R()).adjoint()
            }

            fn solve(m: &DMatrix<Self>, rhs: &DMatrix<Self>) -> DMatrix<Self> {
                owned(view(m).partial_piv_lu().solve(view(rhs)).as_ref())
            }
        }
    };
}

decompositions!(f64);
decompositions!(Complex<f64>);
