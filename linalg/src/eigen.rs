//! Eigenvalues, eigenvectors and the Schur form.

use super::{
    CMat, Complex, LinalgError, Mat, balance, check_finite, check_finite_c, no_convergence, owned, view,
};
use faer::Side;
use nalgebra::DMatrix;

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

/// Eigenvalues of a general real matrix, which is balanced first: units of the states and gains from one
/// part to another do not matter.
pub fn eigenvalues(m: &Mat) -> Result<Vec<Complex<f64>>, LinalgError> {
    check_finite("eigenvalues", m)?;
    balanced_eigenvalues(m, raw_eigenvalues).map(|(values, _)| values)
}

/// Eigenvalues of a general complex matrix, balanced first.
pub fn eigenvalues_c(m: &CMat) -> Result<Vec<Complex<f64>>, LinalgError> {
    check_finite_c("eigenvalues", m)?;
    balanced_eigenvalues(m, raw_eigenvalues_c).map(|(values, _)| values)
}

/// Scales that differ by more than this may reduce the accuracy: a change of coordinates magnifies errors
/// by up to its condition, here to 2e-10. Eigenvalues that almost coincide move by the square root of that.
const SAFE_CONDITION: f64 = 1e6;

/// Candidates for the eigenvalues of a general real matrix, for callers to whom a false one does no harm
/// but a missed one does. They are those of [`eigenvalues`] and, if balancing changed scales by many
/// decades, also those of the unbalanced matrix.
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

/// Rotations per row after which a Schur iteration is abandoned; one or two are usual.
const SCHUR_SWEEPS: usize = 100;

/// Real Schur form `m = q t q'`: q orthogonal, t zero below its diagonal except in 2 x 2 blocks.
///
/// faer's Schur form is private, so this is nalgebra's, with a limit on the iterations, because it never
/// ends on some delay lines.
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
