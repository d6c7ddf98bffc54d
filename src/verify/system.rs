//! A system in state-space form whose input enters through its Gram matrix: xi+ = A xi + J u, e = C xi +
//! L u.

use super::ball::{self, Matrix};
use super::error_system::BlockForm;
use super::slow_period::SlowPeriod;
use super::{positive, upper};
use crate::arithmetic::{Ball, DoubleDouble, Number};
use crate::bank::NormBound;
use crate::linalg::Mat;

/// `[xi+; e] = system xi + inputs u`, rows of the state first.
#[derive(Debug, Clone)]
pub(crate) struct EnclosedSystem<F = DoubleDouble> {
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
pub(crate) struct Midpoint {
    /// n x n.
    pub(crate) a: Mat,
    /// n x number of w.
    pub(crate) b: Mat,
    /// m x n.
    pub(crate) c: Mat,
    /// m x number of w.
    pub(crate) d: Mat,
}

impl<F: Number> EnclosedSystem<F> {
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
    pub(crate) fn order(&self) -> usize {
        self.system.ncols()
    }

    /// Whether `bound` proves that its norm is not exceeded.
    pub(crate) fn certifies(&self, bound: &NormBound) -> bool {
        upper::proves(self, bound.norm, [&bound.factor[..], &[][..]])
    }
}

impl EnclosedSystem {
    /// The system in double precision; `None` if the Gram matrix of its inputs has no root, which does not
    /// happen.
    pub(crate) fn midpoint(&self) -> Option<Midpoint> {
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
