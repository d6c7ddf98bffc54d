//! The bounded real lemma with outputs affine in the unknowns.
//!
//! For a fixed stable (A, B) and `C(x) = C_0 + sum_k x_k C_k`, `D(x) = D_0 + sum_k x_k D_k`, minimise gamma such
//! that some symmetric P satisfies
//!
//! ```text
//! [ P - A'PA   -A'PB            C(x)'   ]
//! [ -B'PA      gamma I - B'PB   D(x)'   ]  >= 0,
//! [ C(x)       D(x)             gamma I ]
//! ```
//!
//! which says that `C(x) (zI - A)^-1 B + D(x)` has an H-infinity norm of at most gamma. The
//! dual variable is the covariance `Z = [Zxx Zxu *; Zux Zuu *; Zyx Zyu Zyy]` of states, inputs and outputs:
//!
//! ```text
//! maximise -2 <[Zyx Zyu], [C_0 D_0]>
//! subject to  Zxx = A Zxx A' + A Zxu B' + B Zxu' A' + B Zuu B',   <[Zyx Zyu], [C_k D_k]> = 0,
//!             tr Zuu + tr Zyy = 1,   Z >= 0.
//! ```
//!
//! The Lyapunov equality gives Zxx from the rest, so the Newton system is one in `Zxu, Zuu, Zyx, Zyu,
//! Zyy` and x; the n(n+1)/2 entries of P never meet in a matrix. They follow from a Lyapunov equation
//! afterwards. Both sides are feasible from the first step to the last: any `Zuu > 0` with the
//! Gramian it causes starts the dual, any Lyapunov matrix with a large gamma the primal.
//!
//! Sources: Vandenberghe, Balakrishnan, Wallin, Hansson, Roh, "Interior-point algorithms for
//! semidefinite programming problems derived from the KYP lemma", in *Positive polynomials in
//! control*, 2005 (the elimination); Helmberg et al. 1996 and Kojima et al. 1997 (the
//! direction, here in its dual form); Rump, "Verification of positive definiteness", BIT 46 (2006) (the certificate).

mod certificate;
mod coordinates;
mod covariance;
mod lyapunov;
mod solver;
#[cfg(test)]
mod tests;

pub(crate) use certificate::bounded_real_riccati;
pub use certificate::{Certificate, Refusal, certificate, prove};
pub use coordinates::{Coordinates, gramian_coordinates};
pub use solver::{Solution, Step, minimise};

use super::{SettingError, check_settings};
use crate::linalg::{LinalgError, Mat};
use crate::lti::LtiError;

/// What cannot be a problem.
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
    a: Mat,
    b: Mat,
    c: Mat,
    d: Mat,
    terms: Vec<(Mat, Mat)>,
}

impl Problem {
    /// A: n x n, B: n x m, `c` = C_0: p x n, `d` = D_0: p x m, `terms` = (C_k, D_k).
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

/// Limits and tolerances of the KYP solver.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Most predictor-corrector steps (default 80).
    pub max_iterations: usize,
    /// Wanted gap relative to gamma (default 1e-7; near 1e-9 rounding errors in the Newton matrix end the
    /// progress of this form, the sampled form goes further).
    pub tol_gap_rel: f64,
    /// Gap that is as good as none, relative to the norm of the data (default 1e-13).
    pub tol_gap_abs: f64,
    /// Relative gap up to which a stalled run still counts as solved (default 1e-5).
    pub tol_gap_reduced: f64,
    /// States and combinations of unknowns weaker than this, relative to the strongest, are dropped
    /// (default 1e-12).
    pub tol_rank: f64,
    /// Largest fraction of the way to the boundary of the cone that a step goes (default 0.98).
    pub step_fraction: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_iterations: 80,
            tol_gap_rel: 1e-7,
            tol_gap_abs: 1e-13,
            tol_gap_reduced: 1e-5,
            tol_rank: 1e-12,
            step_fraction: 0.98,
        }
    }
}

impl Settings {
    fn check(&self) -> Result<(), SettingError> {
        check_settings(&[
            ("tol_gap_rel", self.tol_gap_rel),
            ("tol_gap_abs", self.tol_gap_abs),
            ("tol_gap_reduced", self.tol_gap_reduced),
            ("tol_rank", self.tol_rank),
            ("step_fraction", self.step_fraction),
        ])
    }
}
