//! The Hamiltonian matrix of a level: its imaginary eigenvalues are the frequencies at which the gain
//! equals the level.

use crate::linalg::{self, CMat, Complex, LinalgError, Mat};
use crate::lti::StateSpace;
use nalgebra::{ComplexField, DMatrix};
use std::f64::consts::PI;

/// The Hamiltonian matrix whose eigenvalue j tan(w / 2) marks gain(w) = level, w counted from the point
/// opposite to the centre of the Cayley transform, which is 0 or pi. The gain is that of the outputs from
/// `measurements` on, after subtraction of the part that the outputs before explain.
pub(super) fn about_real(
    system: &StateSpace,
    measurements: usize,
    level: f64,
    centre: f64,
) -> Result<Mat, LinalgError> {
    let e = if centre == PI { 1.0 } else { -1.0 };
    let parts = (system.a() * e, system.b() * e, system.c().clone(), system.d().clone());
    hamiltonian(&cayley(parts, linalg::solve), measurements, level, linalg::solve)
}

/// As [`about_real`] for any centre, in complex arithmetic.
pub(super) fn about_any(
    system: &StateSpace,
    measurements: usize,
    level: f64,
    centre: f64,
) -> Result<CMat, LinalgError> {
    let turn = -Complex::from_polar(1.0, -centre);
    let complex = |m: &Mat| linalg::to_complex(m);
    let parts =
        (complex(system.a()) * turn, complex(system.b()) * turn, complex(system.c()), complex(system.d()));
    hamiltonian(&cayley(parts, linalg::solve_c), measurements, level, linalg::solve_c)
}

type Parts<T> = (DMatrix<T>, DMatrix<T>, DMatrix<T>, DMatrix<T>);
type Solve<T> = fn(&DMatrix<T>, &DMatrix<T>) -> DMatrix<T>;

/// s = (z - 1) / (z + 1): the unit circle becomes the imaginary axis, z = -1 infinity.
fn cayley<T: ComplexField>((a, b, c, d): Parts<T>, solve: Solve<T>) -> Parts<T> {
    let n = a.nrows();
    let identity = DMatrix::<T>::identity(n, n);
    let inverse = solve(&(&a + &identity), &identity);
    let b = &inverse * b;
    let d = d - &c * &b;
    let root2 = nalgebra::convert::<f64, T>(std::f64::consts::SQRT_2);
    (&inverse * (a - identity), b * root2.clone(), c * inverse * root2, d)
}

/// The Hamiltonian matrix of a continuous-time system whose eigenvalues on the imaginary axis mark
/// gain = `level`. The gain is that of the outputs from `measurements` on, after subtraction of the part
/// that the outputs before explain.
fn hamiltonian<T: ComplexField>(
    (a, b, c, d): &Parts<T>,
    measurements: usize,
    level: f64,
    solve: Solve<T>,
) -> Result<DMatrix<T>, LinalgError> {
    let mut r = d * d.adjoint();
    for i in measurements..r.nrows() {
        r[(i, i)] -= nalgebra::convert(level * level);
    }
    let s = b * d.adjoint();
    let n = a.nrows();
    let solved = solve(&r, &linalg::hstack(&[c, &s.adjoint()])?);
    let (rc, rs) = (solved.columns(0, n), solved.columns(n, n));
    let drift = a - &s * &rc;
    let (b_part, c_part) = (b * b.adjoint() - s * rs, c.adjoint() * rc);
    linalg::from_blocks(&[&[&drift, &b_part], &[&c_part, &-drift.adjoint()]])
}
