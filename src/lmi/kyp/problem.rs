//! The data of a KYP problem, checked once.

use crate::linalg::{LinalgError, Mat};
use crate::lmi::SettingError;
use crate::lti::LtiError;

/// Why data do not form a KYP problem.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum KypError {
    /// A matrix has the wrong size.
    #[error("{name} is {rows} x {cols} but must be {want_rows} x {want_cols} to fit A, B and the outputs")]
    Size {
        /// Which matrix.
        name: String,
        /// Rows given.
        rows: usize,
        /// Columns given.
        cols: usize,
        /// Rows expected.
        want_rows: usize,
        /// Columns expected.
        want_cols: usize,
    },
    /// NaN or infinity.
    #[error("{name} holds a value that is not finite")]
    NotFinite {
        /// Which matrix.
        name: String,
    },
    /// The lemma needs a stable A.
    #[error("A has spectral radius {radius}; the bounded real lemma needs all poles inside the unit circle")]
    Unstable {
        /// Largest modulus of the eigenvalues of A.
        radius: f64,
    },
    /// A setting is out of its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A Gramian could not be computed.
    #[error(transparent)]
    Lti(#[from] LtiError),
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

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
    /// [`KypError::Size`] and [`KypError::NotFinite`] name the matrix, [`KypError::Unstable`] has the
    /// spectral radius.
    pub fn new(a: Mat, b: Mat, c: Mat, d: Mat, terms: Vec<(Mat, Mat)>) -> Result<Self, KypError> {
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
            return Err(KypError::Unstable { radius });
        }
        Ok(Self { a, b, c, d, terms })
    }

    /// Number of unknowns x.
    pub fn unknowns(&self) -> usize {
        self.terms.len()
    }

    /// `(C(x), D(x))`.
    pub fn outputs(&self, x: &[f64]) -> (Mat, Mat) {
        let (mut c, mut d) = (self.c.clone(), self.d.clone());
        for ((ck, dk), x) in self.terms.iter().zip(x) {
            c += ck * *x;
            d += dk * *x;
        }
        (c, d)
    }
}

fn check(name: &str, m: &Mat, want_rows: usize, want_cols: usize) -> Result<(), KypError> {
    if m.shape() != (want_rows, want_cols) {
        let (rows, cols) = m.shape();
        return Err(KypError::Size { name: name.into(), rows, cols, want_rows, want_cols });
    }
    if m.iter().any(|v| !v.is_finite()) {
        return Err(KypError::NotFinite { name: name.into() });
    }
    Ok(())
}
