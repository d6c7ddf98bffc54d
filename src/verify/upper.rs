//! Upper bound: ||K|| <= gamma by the bounded-real lemma. In the form used here the input of K enters only
//! through its Gram matrix.
//!
//! With xi+ = A xi + J u, e = C xi + L u and the Gram matrix S of u, let P = P' >= 0 satisfy
//!
//! ```text
//! [ P  0         ]   [A]   [A]'   [J]   [J]'
//! [ 0  gamma^2 I ] - [C] P [C]  - [L] S [L]   > 0.
//! ```
//!
//! The first block says P - A P A' > 0, so all eigenvalues of A lie inside the unit circle; and with
//! Psi = C (zI - A)^-1 the product [Psi, I] (..) [Psi, I]* is gamma^2 I - K(z) K(z)* on it. So ||K|| <
//! gamma. The certificate in the file is a lower triangular factor of P = R R', with a correction of it
//! where doubles are too coarse.

use super::ball::{self, Ball, Matrix};
use super::error_system::ErrorSystem;
use super::positive;
use crate::arithmetic::Number;
use crate::bank::Certificate;

/// Whether `certificate` proves `||K|| <= gamma` in the precision of F.
pub(super) fn proves<F: Number>(error: &ErrorSystem<F>, certificate: &Certificate) -> bool {
    certificate.factor.len() == error.order()
        && positive::is_positive_definite(&inequality(error, certificate))
}

/// R, enclosed.
fn triangular<F: Number>(certificate: &Certificate) -> Matrix<F> {
    let n = certificate.factor.len();
    let entry = |rows: &[Vec<f64>], i: usize, j: usize| {
        rows.get(i).and_then(|row| row.get(j)).map_or(Ball::ZERO, |&x| Ball::from(x))
    };
    Matrix::from_fn(n, n, |i, j| entry(&certificate.factor, i, j) + entry(&certificate.correction, i, j))
}

/// The matrix that has to be positive definite.
fn inequality<F: Number>(error: &ErrorSystem<F>, certificate: &Certificate) -> Matrix<F> {
    let (n, m) = (error.order(), error.outputs);
    let root = triangular(certificate);
    let p = ball::product_transposed(&root, &root);
    let mut left = ball::zeros(n + m, n + m);
    left.view_mut((0, 0), (n, n)).copy_from(&p);
    let square = Ball::from(certificate.gamma) * Ball::from(certificate.gamma);
    (n..n + m).for_each(|i| left[(i, i)] = square);
    let moved = ball::congruence(&error.system, &p);
    left - (moved + error.input_gram())
}
