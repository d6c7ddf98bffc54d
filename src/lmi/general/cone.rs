//! Elements of the product of all cones: one symmetric matrix or vector for each inequality.

use super::problem::{Problem, dot};
use crate::linalg::{self, LinalgError, Mat};
use crate::lmi::step;

/// Slacks, dual variables or a direction of either.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Element {
    pub(super) matrices: Vec<Mat>,
    pub(super) vectors: Vec<Vec<f64>>,
}

impl Element {
    /// The identity of every cone.
    pub(super) fn identity(problem: &Problem) -> Self {
        Self {
            matrices: problem.matrices.iter().map(|b| Mat::identity(b.order, b.order)).collect(),
            vectors: problem.linear.iter().map(|b| vec![1.0; b.constant.len()]).collect(),
        }
    }

    pub(super) fn zero(problem: &Problem) -> Self {
        let mut z = Self::identity(problem);
        z.scale(0.0);
        z
    }

    /// The constants `F0_k`, `g_k`.
    pub(super) fn constants(problem: &Problem) -> Self {
        let mut f = Self::zero(problem);
        problem.matrices.iter().zip(&mut f.matrices).for_each(|(b, m)| b.constant.add_to(1.0, m));
        f.vectors = problem.linear.iter().map(|b| b.constant.clone()).collect();
        f
    }

    /// `sum_i x_i F_i` without the constants.
    pub(super) fn image(problem: &Problem, x: &[f64]) -> Self {
        let mut f = Self::zero(problem);
        for (block, m) in problem.matrices.iter().zip(&mut f.matrices) {
            block.terms.iter().for_each(|(i, t)| t.add_to(x[*i], m));
        }
        for (block, v) in problem.linear.iter().zip(&mut f.vectors) {
            block.entries.iter().for_each(|&(row, i, a)| v[row] += a * x[i]);
        }
        f
    }

    /// `<F_i, self>` for all unknowns.
    pub(super) fn adjoint(&self, problem: &Problem) -> Vec<f64> {
        let mut a = vec![0.0; problem.unknowns()];
        for (block, m) in problem.matrices.iter().zip(&self.matrices) {
            block.terms.iter().for_each(|(i, t)| a[*i] += t.inner(m));
        }
        for (block, v) in problem.linear.iter().zip(&self.vectors) {
            block.entries.iter().for_each(|&(row, i, g)| a[i] += g * v[row]);
        }
        a
    }

    pub(super) fn inner(&self, other: &Self) -> f64 {
        let matrices: f64 = self.matrices.iter().zip(&other.matrices).map(|(a, b)| a.dot(b)).sum();
        matrices + self.vectors.iter().zip(&other.vectors).map(|(a, b)| dot(a, b)).sum::<f64>()
    }

    pub(super) fn norm(&self) -> f64 {
        self.inner(self).sqrt()
    }

    /// `self += alpha other`.
    pub(super) fn add(&mut self, alpha: f64, other: &Self) {
        for (a, b) in self.matrices.iter_mut().zip(&other.matrices) {
            a.zip_apply(b, |x, y| *x += alpha * y);
        }
        for (a, b) in self.vectors.iter_mut().zip(&other.vectors) {
            a.iter_mut().zip(b).for_each(|(x, y)| *x += alpha * y);
        }
    }

    pub(super) fn scale(&mut self, alpha: f64) {
        self.matrices.iter_mut().for_each(|m| *m *= alpha);
        self.vectors.iter_mut().flatten().for_each(|v| *v *= alpha);
    }

    /// Inverse of every matrix and entry; the element must lie inside the cone.
    pub(super) fn inverse(&self) -> Result<Self, LinalgError> {
        let invert = |m: &Mat| {
            let n = m.nrows();
            let inverse = linalg::solve_positive(m, &Mat::identity(n, n))?;
            Ok(linalg::symmetric_part(&inverse))
        };
        let matrices = self.matrices.iter().map(invert).collect::<Result<_, _>>()?;
        let vectors = self.vectors.iter().map(|v| v.iter().map(|x| 1.0 / x).collect()).collect();
        Ok(Self { matrices, vectors })
    }

    /// `sym(X self Z)`, entry by entry `x y z` for vectors.
    pub(super) fn between(&self, x: &Self, z: &Self) -> Self {
        let matrix = |((y, x), z): ((&Mat, &Mat), &Mat)| linalg::symmetric_part(&(x * y * z));
        let vector = |((y, x), z): ((&Vec<f64>, &Vec<f64>), &Vec<f64>)| {
            y.iter().zip(x).zip(z).map(|((y, x), z)| x * y * z).collect()
        };
        Self {
            matrices: self.matrices.iter().zip(&x.matrices).zip(&z.matrices).map(matrix).collect(),
            vectors: self.vectors.iter().zip(&x.vectors).zip(&z.vectors).map(vector).collect(),
        }
    }

    /// Largest step along `direction` that stays in the cone (infinite if none leaves it).
    pub(super) fn reach(&self, direction: &Self) -> Result<f64, LinalgError> {
        let mut reach = f64::INFINITY;
        for (m, d) in self.matrices.iter().zip(&direction.matrices) {
            reach = reach.min(step::reach(m, d)?);
        }
        for (v, d) in self.vectors.iter().flatten().zip(direction.vectors.iter().flatten()) {
            if *d < 0.0 {
                reach = reach.min(-v / d);
            }
        }
        Ok(reach)
    }

    /// Sum of the orders of all cones.
    pub(super) fn order(&self) -> usize {
        self.matrices.iter().map(Mat::nrows).sum::<usize>() + self.vectors.iter().map(Vec::len).sum::<usize>()
    }
}
