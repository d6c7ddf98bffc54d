//! A system in state-space form whose input enters through its Gram matrix: xi+ = A xi + J u, e = C xi +
//! L u.
//!
//! # Upper bound of the norm
//! ||K|| <= gamma by the bounded-real lemma. With the Gram matrix S of u, let P = P' >= 0 satisfy
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
use super::error_system::BlockForm;
use super::positive;
use super::slow_period::SlowPeriod;
use crate::arithmetic::{DoubleDouble, Float};
use hybank_core::bank::NormBound;
use hybank_linalg::Mat;

/// `[xi+; e] = system xi + inputs u`, rows of the state first.
#[derive(Debug, Clone)]
pub struct EnclosedSystem<F = DoubleDouble> {
    /// [A; C], (n + m) x n.
    pub(super) system: Matrix<F>,
    /// [J; L], (n + m) x (number of u).
    pub(super) inputs: Matrix<F>,
    /// Gram matrix of u.
    pub(super) gram: Matrix<F>,
    /// m, the number of e.
    pub(super) outputs: usize,
}

/// Midpoints of an enclosed system, for the search for a certificate: xi+ = a xi + b w, e = c xi + d w with
/// w white.
#[derive(Debug, Clone)]
pub struct Midpoint {
    /// n x n.
    pub a: Mat,
    /// n x number of w.
    pub b: Mat,
    /// m x n.
    pub c: Mat,
    /// m x number of w.
    pub d: Mat,
}

impl<F: Float> EnclosedSystem<F> {
    /// Filters whose inputs are white with these powers.
    pub(super) fn of_filters(filters: &BlockForm<F>, powers: &[Ball<F>]) -> Self {
        let BlockForm { a, b, c, d } = filters;
        let on_diagonal = |i: usize, j: usize| if i == j { powers[i] } else { Ball::ZERO };
        Self {
            system: ball::above(a, c),
            inputs: ball::above(b, d),
            gram: Matrix::from_fn(powers.len(), powers.len(), on_diagonal),
            outputs: d.nrows(),
        }
    }

    /// The samples of a slow period times `scales`. By how many whole periods a sample is late changes no
    /// norm.
    pub(super) fn of_samples(period: &SlowPeriod<F>, scales: &[f64]) -> Self {
        let (n, outputs) = (period.order(), period.samples());
        let scale = |i: usize| Ball::from(if i < n { 1.0 } else { scales[i - n] });
        let inputs =
            Matrix::from_fn(n + outputs, n + outputs, |i, j| if i == j { scale(i) } else { Ball::ZERO });
        let rows = ball::above(&period.transition, &period.outputs);
        let system = Matrix::from_fn(n + outputs, n, |i, j| rows[(i, j)] * scale(i));
        Self { system, inputs, gram: period.gram.clone(), outputs }
    }

    /// [J; L] S [J; L]', the energy of the input.
    pub(super) fn input_gram(&self) -> Matrix<F> {
        ball::congruence(&self.inputs, &self.gram)
    }

    /// n, the number of states.
    pub fn order(&self) -> usize {
        self.system.ncols()
    }

    /// Whether R, the sum of the lower triangles `factor`, proves `||K|| <= gamma` in the precision of F.
    pub(super) fn proves(&self, gamma: f64, factor: [&[Vec<f64>]; 2]) -> bool {
        factor[0].len() == self.order() && positive::is_positive_definite(&self.inequality(gamma, factor))
    }

    /// The matrix that has to be positive definite.
    fn inequality(&self, gamma: f64, factor: [&[Vec<f64>]; 2]) -> Matrix<F> {
        let (n, m) = (self.order(), self.outputs);
        let root = triangular(factor);
        let p = ball::product_transposed(&root, &root);
        let mut left = ball::zeros(n + m, n + m);
        left.view_mut((0, 0), (n, n)).copy_from(&p);
        let square = Ball::from(gamma) * Ball::from(gamma);
        (n..n + m).for_each(|i| left[(i, i)] = square);
        let moved = ball::congruence(&self.system, &p);
        left - (moved + self.input_gram())
    }

    /// Whether `bound` proves that its norm is not exceeded.
    pub fn certifies(&self, bound: &NormBound) -> bool {
        self.proves(bound.norm, [&bound.factor[..], &[][..]])
    }
}

impl EnclosedSystem {
    /// The system in double precision; `None` if the Gram matrix of its inputs has no root, which does not
    /// happen.
    pub fn midpoint(&self) -> Option<Midpoint> {
        let root = positive::root(&self.gram)?;
        let (n, m) = (self.order(), self.outputs);
        let system = ball::nearest(&self.system);
        let inputs: Matrix = ball::product(&self.inputs, &root);
        let inputs = ball::nearest(&inputs);
        Some(Midpoint {
            a: system.rows(0, n).into_owned(),
            b: inputs.rows(0, n).into_owned(),
            c: system.rows(n, m).into_owned(),
            d: inputs.rows(n, m).into_owned(),
        })
    }
}

/// R, enclosed.
fn triangular<F: Float>(factor: [&[Vec<f64>]; 2]) -> Matrix<F> {
    let n = factor[0].len();
    let entry = |rows: &[Vec<f64>], i: usize, j: usize| {
        rows.get(i).and_then(|row| row.get(j)).map_or(Ball::ZERO, |&x| Ball::from(x))
    };
    Matrix::from_fn(n, n, |i, j| entry(factor[0], i, j) + entry(factor[1], i, j))
}
