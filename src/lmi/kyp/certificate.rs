//! Proof in floating point that a given system has an H-infinity norm of at most gamma.

use super::solver::assemble;
use crate::linalg::{self, LinalgError, Mat};
use crate::lti::riccati::{RiccatiOutcome, solve_doubling};

/// Relative slacks tried between gamma and the gamma that the Riccati equation is solved for, and
/// the weights on the states (relative to it) that keep the LMI away from singular.
const SLACKS: [f64; 9] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10];
const STATE_WEIGHTS: [f64; 3] = [1.0, 1e-3, 1e-6];
/// A margin this many times the errors charged is not worth improving.
const AMPLE: f64 = 1e3;
/// Safety on error bounds that are themselves computed in floating point, and on the order of the sums.
const SAFETY: f64 = 4.0;
/// Parts of the least eigenvalue that are tried as proven margin.
const MARGINS: [f64; 4] = [0.9, 0.5, 0.1, 0.0];

/// A proven bounded-real LMI.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// P, n x n.
    pub p: Mat,
    /// The norm is at most this.
    pub gamma: f64,
    /// Proven lower bound on the least eigenvalue of the LMI's matrix; at least 0.
    pub margin: f64,
    /// What was charged for rounding errors.
    pub charged: f64,
}

/// Why there is no proof.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// Sizes do not fit.
    #[error("A {a:?}, B {b:?}, C {c:?}, D {d:?} (rows, columns) do not form a system")]
    Size {
        /// Of A.
        a: (usize, usize),
        /// Of B.
        b: (usize, usize),
        /// Of C.
        c: (usize, usize),
        /// Of D.
        d: (usize, usize),
    },
    /// The feedthrough alone is larger than gamma.
    #[error("gamma = {gamma} does not exceed the norm of D, {feedthrough}, which bounds it below")]
    Feedthrough {
        /// The gamma given.
        gamma: f64,
        /// Norm of D.
        feedthrough: f64,
    },
    /// No Riccati equation near gamma could be solved: gamma is below the norm or too close to it.
    #[error("the bounded-real Riccati equation has no stabilising solution at gamma = {gamma}: raise gamma")]
    Riccati {
        /// The gamma given.
        gamma: f64,
    },
    /// P was found but the LMI is not positive definite beyond rounding errors.
    #[error(
        "the LMI's least eigenvalue {least} does not exceed the rounding errors {charged}: raise gamma or balance the states"
    )]
    NotProven {
        /// Computed least eigenvalue.
        least: f64,
        /// Rounding errors charged.
        charged: f64,
    },
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// Finds P for `C (zI - A)^-1 B + D` at `gamma` and proves the bounded-real LMI.
///
/// P solves a Riccati equation for a slightly smaller gamma with a small weight on all states,
/// so that the LMI at gamma is strictly positive. Give the system in coordinates of comparable size
/// ([`super::gramian_coordinates`]): the proof is about the very numbers handed in, and in badly scaled
/// coordinates rounding errors drown it.
pub fn certificate(a: &Mat, b: &Mat, c: &Mat, d: &Mat, gamma: f64) -> Result<Certificate, Refusal> {
    check_sizes(a, b, c, d)?;
    let feedthrough = linalg::singular_values(d)?.first().copied().unwrap_or(0.0);
    if gamma.is_nan() || gamma <= feedthrough {
        return Err(Refusal::Feedthrough { gamma, feedthrough });
    }
    let mut best: Result<Certificate, Refusal> = Err(Refusal::Riccati { gamma });
    for slack in SLACKS {
        let inner = gamma * (1.0 - slack);
        for weight in STATE_WEIGHTS.iter().filter(|_| inner > feedthrough) {
            let Some(p) = bounded_real_riccati(a, b, c, d, inner, weight * slack * gamma) else { continue };
            best = better(best, prove(a, b, c, d, &p, gamma));
        }
        if best.as_ref().is_ok_and(|proof| proof.margin > AMPLE * proof.charged) {
            break;
        }
    }
    best
}

/// The proof with the larger margin; any proof before none.
fn better(a: Result<Certificate, Refusal>, b: Result<Certificate, Refusal>) -> Result<Certificate, Refusal> {
    match (&a, &b) {
        (Ok(x), Ok(y)) if x.margin >= y.margin => a,
        (Ok(_), Err(_)) => a,
        _ => b,
    }
}

fn check_sizes(a: &Mat, b: &Mat, c: &Mat, d: &Mat) -> Result<(), Refusal> {
    let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
    if a.ncols() == n && b.nrows() == n && c.ncols() == n && d.shape() == (p, m) {
        return Ok(());
    }
    Err(Refusal::Size { a: a.shape(), b: b.shape(), c: c.shape(), d: d.shape() })
}

/// The P of the bounded-real lemma at g with `weight` on all states, or nothing where no stabilising solution is found:
/// `P = A'PA + C'C/g + weight I + (A'PB + C'D/g)(g I - D'D/g - B'PB)^-1 (..)'`, in the form
/// `P = F'P (I + G P)^-1 F + H` with `R = g I - D'D/g`, `F = A + B R^-1 D'C/g`, `G = -B R^-1 B'`,
/// `H = C'C/g + C'D R^-1 D'C/g^2 + weight I`.
pub(crate) fn bounded_real_riccati(a: &Mat, b: &Mat, c: &Mat, d: &Mat, g: f64, weight: f64) -> Option<Mat> {
    let m = b.ncols();
    let r = Mat::identity(m, m) * g - d.tr_mul(d) / g;
    let dc = d.tr_mul(c) / g;
    let solved = linalg::solve_positive(&r, &dc).ok()?;
    let inverse_b = linalg::solve_positive(&r, &b.transpose()).ok()?;
    let f = a + b * &solved;
    let neg = -linalg::symmetric_part(&(b * inverse_b));
    let n = a.nrows();
    let h = linalg::symmetric_part(&(c.tr_mul(c) / g + dc.tr_mul(&solved) + Mat::identity(n, n) * weight));
    match solve_doubling(&f, &neg, &h) {
        RiccatiOutcome::Solved(solution) => Some(linalg::symmetric_part(&solution.x)),
        RiccatiOutcome::Unresolved { .. } => None,
    }
}

/// Proves `LMI(P, gamma) >= margin I` for the numbers as given, whatever P is (of a symmetric P, that is).
///
/// The LMI's matrix is computed with an entrywise error bound; then one Cholesky factorisation of the
/// matrix less all errors and less the factorisation's own error `(order + 1) eps trace` (Rump 2006)
/// proves it. A stable A with `P - A'PA > 0` then gives `P >= 0` and the bound on the norm.
pub fn prove(a: &Mat, b: &Mat, c: &Mat, d: &Mat, p: &Mat, gamma: f64) -> Result<Certificate, Refusal> {
    check_sizes(a, b, c, d)?;
    let p = linalg::symmetric_part(p);
    let k = side_by_side(c, d);
    let lmi = assemble(&p, a, b, &k, gamma);
    let order = lmi.nrows();
    let errors = product_errors(a, b, &p, gamma);
    let factor = SAFETY * (order + 1) as f64 * f64::EPSILON * lmi.trace().abs();
    let charged = errors + factor;
    let least = linalg::symmetric_eigenvalues(&lmi)?.first().copied().unwrap_or(gamma);
    for part in MARGINS {
        let margin = part * (least - charged).max(0.0);
        let shifted = &lmi - Mat::identity(order, order) * (charged + margin);
        if least > charged && linalg::cholesky(&shifted).is_ok() {
            return Ok(Certificate { p, gamma, margin, charged });
        }
    }
    Err(Refusal::NotProven { least, charged })
}

fn side_by_side(c: &Mat, d: &Mat) -> Mat {
    let mut k = Mat::zeros(c.nrows(), c.ncols() + d.ncols());
    k.columns_mut(0, c.ncols()).copy_from(c);
    k.columns_mut(c.ncols(), d.ncols()).copy_from(d);
    k
}

/// Bound on the spectral norm of the errors in the LMI's entries: each is a sum of triple products,
/// two inner products of length n deep.
fn product_errors(a: &Mat, b: &Mat, p: &Mat, gamma: f64) -> f64 {
    let n = a.nrows();
    let both = side_by_side(a, b).abs();
    let mut size = both.tr_mul(&(p.abs() * &both));
    (0..n).for_each(|i| (0..n).for_each(|j| size[(i, j)] += p[(i, j)].abs()));
    (n..size.nrows()).for_each(|i| size[(i, i)] += gamma);
    let rows = size.row_iter().map(|r| r.sum()).fold(0.0, f64::max);
    SAFETY * (2 * n + 4) as f64 * f64::EPSILON * rows
}
