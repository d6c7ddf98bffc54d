//! The data of a general problem, checked as they are added.

use super::coefficient::Coefficient;
use crate::linalg::{LinalgError, Mat};
use crate::lmi::SettingError;

/// What cannot be a problem.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GeneralError {
    /// A term names an unknown that does not exist.
    #[error(
        "a term of {block} belongs to unknown {unknown}, but there are only {unknowns} (numbered from 0)"
    )]
    Unknown {
        /// Which inequality.
        block: String,
        /// The index given.
        unknown: usize,
        /// How many there are.
        unknowns: usize,
    },
    /// A coefficient has the wrong size or an index out of range.
    #[error("{block} has order {order}, but a coefficient of it {what}")]
    Shape {
        /// Which inequality.
        block: String,
        /// Its order.
        order: usize,
        /// What is wrong.
        what: String,
    },
    /// A dense coefficient is not symmetric.
    #[error(
        "{block}: entries ({row}, {col}) and ({col}, {row}) of a coefficient differ; give the symmetric part"
    )]
    NotSymmetric {
        /// Which inequality.
        block: String,
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        col: usize,
    },
    /// NaN or infinity.
    #[error("{block} holds a value that is not finite")]
    NotFinite {
        /// Which part of the data.
        block: String,
    },
    /// The equalities have the wrong size.
    #[error(
        "the equalities are {rows} x {cols} with {rhs} right-hand sides, but there are {unknowns} unknowns"
    )]
    Equalities {
        /// Rows of A.
        rows: usize,
        /// Columns of A.
        cols: usize,
        /// Length of b.
        rhs: usize,
        /// Unknowns.
        unknowns: usize,
    },
    /// A setting is out of its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A decomposition failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// One matrix inequality `constant + sum x_i terms_i >= 0`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MatrixBlock {
    pub(super) order: usize,
    pub(super) constant: Coefficient,
    pub(super) terms: Vec<(usize, Coefficient)>,
}

/// Linear inequalities `constant + G x >= 0`, G by (row, unknown, value).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LinearBlock {
    pub(super) constant: Vec<f64>,
    pub(super) entries: Vec<(usize, usize, f64)>,
}

/// A general problem; start from the cost and add inequalities.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    pub(super) cost: Vec<f64>,
    pub(super) matrices: Vec<MatrixBlock>,
    pub(super) linear: Vec<LinearBlock>,
    pub(super) equality: Mat,
    pub(super) rhs: Vec<f64>,
}

impl Problem {
    /// Minimise `cost' x` without any condition yet. Fails on NaN or infinity.
    pub fn new(cost: Vec<f64>) -> Result<Self, GeneralError> {
        finite("the cost", cost.iter())?;
        let equality = Mat::zeros(0, cost.len());
        Ok(Self { cost, matrices: Vec::new(), linear: Vec::new(), equality, rhs: Vec::new() })
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.cost.len()
    }

    /// Adds `constant + sum_i x_i F_i >= 0` of the given order; `terms` are (i, F_i), each i at most once
    /// (repeated ones add up all the same).
    pub fn matrix_inequality(
        mut self,
        order: usize,
        constant: Coefficient,
        terms: Vec<(usize, Coefficient)>,
    ) -> Result<Self, GeneralError> {
        let block = format!("matrix inequality {}", self.matrices.len());
        check_coefficient(&block, order, &constant)?;
        for (unknown, term) in &terms {
            check_unknown(&block, *unknown, self.unknowns())?;
            check_coefficient(&block, order, term)?;
        }
        self.matrices.push(MatrixBlock { order, constant, terms });
        Ok(self)
    }

    /// Adds `constant + G x >= 0`, one inequality an entry of `constant`; `entries` are (row, unknown,
    /// value), repeated ones add up.
    pub fn linear_inequalities(
        mut self,
        constant: Vec<f64>,
        entries: Vec<(usize, usize, f64)>,
    ) -> Result<Self, GeneralError> {
        let block = format!("set of linear inequalities {}", self.linear.len());
        finite(&block, constant.iter().chain(entries.iter().map(|(_, _, v)| v)))?;
        for &(row, unknown, _) in &entries {
            check_unknown(&block, unknown, self.unknowns())?;
            if row >= constant.len() {
                let what = format!("has row {row} (numbered from 0)");
                return Err(GeneralError::Shape { block, order: constant.len(), what });
            }
        }
        self.linear.push(LinearBlock { constant, entries });
        Ok(self)
    }

    /// Sets the equalities `a x = b`. Their rows should be independent.
    pub fn equalities(mut self, a: Mat, b: Vec<f64>) -> Result<Self, GeneralError> {
        if a.nrows() != b.len() || a.ncols() != self.unknowns() {
            let (rows, cols) = a.shape();
            return Err(GeneralError::Equalities { rows, cols, rhs: b.len(), unknowns: self.unknowns() });
        }
        finite("the set of equalities", a.iter().chain(&b))?;
        (self.equality, self.rhs) = (a, b);
        Ok(self)
    }

    /// `F_k(x)` of the matrix inequality k.
    pub fn matrix_at(&self, k: usize, x: &[f64]) -> Mat {
        let block = &self.matrices[k];
        let mut f = Mat::zeros(block.order, block.order);
        block.constant.add_to(1.0, &mut f);
        block.terms.iter().for_each(|(i, term)| term.add_to(x[*i], &mut f));
        f
    }

    /// `g_k + G_k x` of the set of linear inequalities k.
    pub fn linear_at(&self, k: usize, x: &[f64]) -> Vec<f64> {
        let mut g = self.linear[k].constant.clone();
        self.linear[k].entries.iter().for_each(|&(row, i, v)| g[row] += v * x[i]);
        g
    }

    /// `c_i - sum_k <F_ik, Z_k> - (A'lambda)_i` with the cost times `tau`.
    pub(super) fn dual_residual(&self, tau: f64, dual: &super::Dual) -> Vec<f64> {
        let mut r: Vec<f64> = self.cost.iter().map(|c| tau * c).collect();
        for (block, z) in self.matrices.iter().zip(&dual.matrices) {
            block.terms.iter().for_each(|(i, term)| r[*i] -= term.inner(z));
        }
        for (block, z) in self.linear.iter().zip(&dual.vectors) {
            block.entries.iter().for_each(|&(row, i, v)| r[i] -= v * z[row]);
        }
        for (row, lambda) in dual.equalities.iter().enumerate() {
            r.iter_mut().enumerate().for_each(|(i, r)| *r -= self.equality[(row, i)] * lambda);
        }
        r
    }

    /// `-<F0, Z> + b'lambda`.
    pub fn dual_objective(&self, dual: &super::Dual) -> f64 {
        let matrices = self.matrices.iter().zip(&dual.matrices).map(|(b, z)| b.constant.inner(z));
        let vectors = self.linear.iter().zip(&dual.vectors).map(|(b, z)| dot(&b.constant, z));
        dot(&self.rhs, &dual.equalities) - matrices.sum::<f64>() - vectors.sum::<f64>()
    }
}

/// `a'b`.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Euclidean norm.
pub(super) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

fn finite<'a>(block: &str, mut values: impl Iterator<Item = &'a f64>) -> Result<(), GeneralError> {
    if values.all(|v| v.is_finite()) { Ok(()) } else { Err(GeneralError::NotFinite { block: block.into() }) }
}

fn check_unknown(block: &str, unknown: usize, unknowns: usize) -> Result<(), GeneralError> {
    if unknown < unknowns {
        return Ok(());
    }
    Err(GeneralError::Unknown { block: block.into(), unknown, unknowns })
}

fn check_coefficient(block: &str, order: usize, f: &Coefficient) -> Result<(), GeneralError> {
    let shape = |what: String| Err(GeneralError::Shape { block: block.into(), order, what });
    match f {
        Coefficient::Dense(m) => {
            finite(block, m.iter())?;
            if m.shape() != (order, order) {
                return shape(format!("is {} x {}", m.nrows(), m.ncols()));
            }
            symmetric(block, m)
        }
        Coefficient::Sparse(entries) => {
            finite(block, entries.iter().map(|(_, _, v)| v))?;
            match entries.iter().find(|(a, b, _)| *a.max(b) >= order) {
                Some((a, b, _)) => shape(format!("has an entry ({a}, {b})")),
                None => Ok(()),
            }
        }
        Coefficient::LowRank { vectors, weights } => {
            finite(block, vectors.iter().chain(weights))?;
            if vectors.nrows() != order || vectors.ncols() != weights.len() {
                let (rows, cols) = vectors.shape();
                return shape(format!("has {rows} x {cols} vectors for {} weights", weights.len()));
            }
            Ok(())
        }
    }
}

fn symmetric(block: &str, m: &Mat) -> Result<(), GeneralError> {
    for col in 0..m.ncols() {
        for row in col + 1..m.nrows() {
            let (a, b) = (m[(row, col)], m[(col, row)]);
            if (a - b).abs() > 1e-12 * m.amax() {
                return Err(GeneralError::NotSymmetric { block: block.into(), row, col });
            }
        }
    }
    Ok(())
}
