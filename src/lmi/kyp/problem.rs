//! The data of a KYP problem, checked once, and the problem of the iteration.

use crate::linalg::{self, LinalgError, Mat};
use crate::lmi::LmiError;
use crate::lti::GramianCoordinates;

/// A KYP problem with consistent sizes and a stable A.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    pub(super) a: Mat,
    pub(super) b: Mat,
    pub(super) c: Mat,
    pub(super) d: Mat,
    pub(super) terms: Vec<(Mat, Mat)>,
}

impl Problem {
    /// A: n x n, B: n x m, `c` = C_0: p x n, `d` = D_0: p x m, `terms` = (C_k, D_k).
    ///
    /// # Errors
    /// [`LmiError::Size`] and [`LmiError::NotFinite`] name the matrix, [`LmiError::Unstable`] has the
    /// spectral radius.
    pub fn new(a: Mat, b: Mat, c: Mat, d: Mat, terms: Vec<(Mat, Mat)>) -> Result<Self, LmiError> {
        let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
        check("A", &a, n, n)?;
        check("B", &b, n, m)?;
        check("C_0", &c, p, n)?;
        check("D_0", &d, p, m)?;
        for (k, (ck, dk)) in terms.iter().enumerate() {
            check(&format!("C_{}", k + 1), ck, p, n)?;
            check(&format!("D_{}", k + 1), dk, p, m)?;
        }
        let radius = crate::linalg::spectral_radius(&a)?;
        if radius >= 1.0 {
            return Err(LmiError::Unstable { radius });
        }
        Ok(Self { a, b, c, d, terms })
    }
}

fn check(name: &str, m: &Mat, want_rows: usize, want_cols: usize) -> Result<(), LmiError> {
    let (given, wanted) = (m.shape(), (want_rows, want_cols));
    if given != wanted {
        return Err(LmiError::Size { name: name.into(), given, wanted });
    }
    if m.iter().any(|v| !v.is_finite()) {
        return Err(LmiError::NotFinite { name: name.into() });
    }
    Ok(())
}

/// The problem of the iteration, in Gramian coordinates and relative to the outputs of least squares. In
/// these coordinates the squared H2 norm is the squared norm of [C D], so that the H2-optimal unknowns are a
/// projection: `vec [C D] = k0 + terms y`, orthonormal `terms` orthogonal to `k0`, `|k0| = 1`.
pub(super) struct Reduced {
    pub(super) coordinates: GramianCoordinates,
    pub(super) outputs: usize,
    pub(super) k0: Mat,
    pub(super) terms: Mat,
    /// `x = origin + scale back y`.
    origin: Mat,
    back: Mat,
    pub(super) scale: f64,
    pub(super) size: f64,
}

impl Reduced {
    pub(super) fn new(problem: &Problem, tol_rank: f64) -> Result<Self, LmiError> {
        let coordinates = GramianCoordinates::new(&problem.a, &problem.b, tol_rank)?;
        let flat = |c: &Mat, d: &Mat| {
            let c = c * &coordinates.basis;
            Mat::from_iterator(c.len() + d.len(), 1, c.iter().chain(d.iter()).copied())
        };
        let k0 = flat(&problem.c, &problem.d);
        let columns: Vec<Mat> = problem.terms.iter().map(|(c, d)| flat(c, d)).collect();
        let strength: Vec<f64> = columns.iter().map(|k| k.norm()).collect();
        let unit = |k: usize| if strength[k] > 0.0 { 1.0 / strength[k] } else { 0.0 };
        let all = Mat::from_fn(k0.len(), columns.len(), |i, k| columns[k][i] * unit(k));
        let (terms, back) = orthonormal(&all, tol_rank)?;
        let back = Mat::from_fn(columns.len(), terms.ncols(), |k, r| unit(k) * back[(k, r)]);
        let (mut rest, mut removed) = (k0.clone(), Mat::zeros(terms.ncols(), 1));
        for _ in 0..2 {
            let component = terms.tr_mul(&rest);
            rest -= &terms * &component;
            removed += component;
        }
        let (scale, size) = (rest.norm(), k0.norm());
        let origin = -(&back * removed);
        let k0 = if scale > 0.0 { rest / scale } else { rest };
        Ok(Self { coordinates, outputs: problem.c.nrows(), k0, terms, origin, back, scale, size })
    }

    pub(super) fn unknowns(&self, y: &[f64]) -> Vec<f64> {
        let mut y = y.to_vec();
        y.resize(self.terms.ncols(), 0.0);
        let x = &self.origin + &self.back * Mat::from_column_slice(y.len(), 1, &y) * self.scale;
        x.as_slice().to_vec()
    }

    /// [C D], p x (n + m), for the reduced unknowns (with or without the constant part).
    pub(super) fn outputs(&self, y: &[f64], constant: f64) -> Mat {
        let k = &self.k0 * constant + &self.terms * Mat::from_column_slice(y.len(), 1, y);
        Mat::from_column_slice(self.outputs, k.len() / self.outputs, k.as_slice())
    }
}

/// Orthonormal columns that span those of `all`, and the combinations of columns that give them.
fn orthonormal(all: &Mat, tol_rank: f64) -> Result<(Mat, Mat), LinalgError> {
    if all.is_empty() {
        return Ok((Mat::zeros(all.nrows(), 0), Mat::zeros(all.ncols(), 0)));
    }
    let svd = linalg::svd(all)?;
    let rank = svd.rank(tol_rank);
    let back = Mat::from_fn(all.ncols(), rank, |k, r| svd.v[(k, r)] / svd.s[r]);
    Ok((svd.u.columns(0, rank).into_owned(), back))
}
