//! A bank without what is read from its states: a line of past inputs, and a recursion at the end of it.

use crate::design::DesignError;
use crate::linalg::{self, Mat};
use crate::lti::balanced::balanced_when_driven;
use crate::lti::{StateSpace, TappedRecursion};

/// States that matter less than this share of the output are rounding.
const NEGLIGIBLE: f64 = 1e-12;

/// x+ = a x + b u[k - ticks].
#[derive(Debug, Clone)]
pub(super) struct Dynamics {
    /// Past inputs that are kept.
    pub(super) ticks: usize,
    pub(super) a: Mat,
    /// r x N.
    pub(super) b: Mat,
}

impl Dynamics {
    /// All of `bank` behind a line of `ticks` inputs, the states that matter most first; `reach` is a square root of the
    /// covariance of its states in use.
    pub(super) fn balanced(bank: &StateSpace, ticks: usize, reach: &Mat) -> Result<Self, DesignError> {
        let tail = TappedRecursion::split(bank, ticks)?.tail().clone();
        let floor = NEGLIGIBLE * (tail.c() * reach).norm();
        let tail = balanced_when_driven(&tail, reach, floor)?;
        Ok(Self { ticks, a: tail.a().clone(), b: tail.b().clone() })
    }

    /// The first `r` states of the recursion alone, or all if there are fewer.
    pub(super) fn truncated(&self, r: usize) -> Self {
        let r = r.min(self.tail());
        let a = self.a.view((0, 0), (r, r)).into_owned();
        Self { ticks: self.ticks, a, b: self.b.rows(0, r).into_owned() }
    }

    /// The states of the recursion divided by `sizes`.
    pub(super) fn scaled(&self, sizes: &[f64]) -> Self {
        let a = Mat::from_fn(self.tail(), self.tail(), |i, j| self.a[(i, j)] * sizes[j] / sizes[i]);
        let b = Mat::from_fn(self.tail(), self.channels(), |i, j| self.b[(i, j)] / sizes[i]);
        Self { ticks: self.ticks, a, b }
    }

    /// r, states of the recursion.
    pub(super) fn tail(&self) -> usize {
        self.a.nrows()
    }

    pub(super) fn channels(&self) -> usize {
        self.b.ncols()
    }

    /// All that an output can be read from: inputs u, outputs X = [x; u[k - ticks]; ..; u[k]].
    pub(super) fn regressors(&self) -> Result<StateSpace, DesignError> {
        let (r, n) = (self.tail(), self.channels());
        let all = Mat::identity(r + n * (self.ticks + 1), r + n * (self.ticks + 1));
        Ok(TappedRecursion::read_by(&all, self.ticks, &self.a, &self.b)?.realise()?)
    }

    /// The bank y = `readout` X.
    pub(super) fn read_by(&self, readout: &Mat) -> Result<TappedRecursion, DesignError> {
        Ok(TappedRecursion::read_by(readout, self.ticks, &self.a, &self.b)?)
    }

    /// Largest modulus of the poles; infinite where they cannot be had.
    pub(super) fn radius(&self) -> f64 {
        linalg::spectral_radius(&self.a).unwrap_or(f64::INFINITY)
    }
}
