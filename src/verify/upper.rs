//! Upper bound: ||K|| <= gamma by the bounded-real lemma. In the form used here the input of a system K
//! enters only through its Gram matrix.
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
//! gamma. The file has a lower triangular factor of P = R R', with a correction of it where doubles are
//! too coarse.

use super::ball::{self, Ball, Matrix};
use super::positive;
use super::system::EnclosedSystem;
use crate::arithmetic::Number;

/// Whether R, the sum of the lower triangles `factor`, proves `||K|| <= gamma` in the precision of F.
pub(super) fn proves<F: Number>(system: &EnclosedSystem<F>, gamma: f64, factor: [&[Vec<f64>]; 2]) -> bool {
    factor[0].len() == system.order() && positive::is_positive_definite(&inequality(system, gamma, factor))
}

/// R, enclosed.
fn triangular<F: Number>(factor: [&[Vec<f64>]; 2]) -> Matrix<F> {
    let n = factor[0].len();
    let entry = |rows: &[Vec<f64>], i: usize, j: usize| {
        rows.get(i).and_then(|row| row.get(j)).map_or(Ball::ZERO, |&x| Ball::from(x))
    };
    Matrix::from_fn(n, n, |i, j| entry(factor[0], i, j) + entry(factor[1], i, j))
}

/// The matrix that has to be positive definite.
fn inequality<F: Number>(system: &EnclosedSystem<F>, gamma: f64, factor: [&[Vec<f64>]; 2]) -> Matrix<F> {
    let (n, m) = (system.order(), system.outputs);
    let root = triangular(factor);
    let p = ball::product_transposed(&root, &root);
    let mut left = ball::zeros(n + m, n + m);
    left.view_mut((0, 0), (n, n)).copy_from(&p);
    let square = Ball::from(gamma) * Ball::from(gamma);
    (n..n + m).for_each(|i| left[(i, i)] = square);
    let moved = ball::congruence(&system.system, &p);
    left - (moved + system.input_gram())
}
