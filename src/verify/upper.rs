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
//! The first block says P - A P A' > 0, so all eigenvalues of A lie inside the unit circle; and with Psi =
//! C (zI - A)^-1 the product [Psi, I] (..) [Psi, I]* is gamma^2 I - K(z) K(z)* on it. So ||K|| < gamma. The
//! certificate in the file is a lower triangular factor of P = R R'.

use super::ball::{self, Ball, Matrix};
use super::error_system::ErrorSystem;
use super::positive;

/// Whether `factor` (rows of a lower triangular R) proves `||K|| <= gamma`.
pub(super) fn proves(error: &ErrorSystem, factor: &[Vec<f64>], gamma: f64) -> bool {
    factor.len() == error.order() && positive::is_positive_definite(&inequality(error, factor, gamma))
}

/// Rows of a triangle as a matrix.
fn triangular(rows: &[Vec<f64>]) -> Matrix {
    let n = rows.len();
    Matrix::from_fn(n, n, |i, j| rows[i].get(j).map_or(Ball::ZERO, |&x| Ball::from(x)))
}

/// The matrix that has to be positive definite.
fn inequality(error: &ErrorSystem, factor: &[Vec<f64>], gamma: f64) -> Matrix {
    let (n, m) = (error.order(), error.outputs);
    let root = triangular(factor);
    let p = ball::product_transposed(&root, &root);
    let mut left = ball::zeros(n + m, n + m);
    left.view_mut((0, 0), (n, n)).copy_from(&p);
    let square = Ball::from(gamma) * Ball::from(gamma);
    (n..n + m).for_each(|i| left[(i, i)] = square);
    let moved = ball::congruence(&error.system, &p);
    let fresh = ball::congruence(&error.inputs, &error.gram);
    ball::subtract(&left, &ball::add(&moved, &fresh))
}
