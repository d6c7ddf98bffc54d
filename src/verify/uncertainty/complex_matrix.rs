//! Complex matrices by their real and imaginary parts.

use super::super::ball::{self, Matrix};
use crate::arithmetic::{ComplexBall, DoubleDouble};
use nalgebra::DMatrix;

/// A complex matrix.
#[derive(Debug, Clone)]
pub(super) struct ComplexMatrix {
    pub(super) re: Matrix,
    pub(super) im: Matrix,
}

impl From<DMatrix<ComplexBall<DoubleDouble>>> for ComplexMatrix {
    fn from(m: DMatrix<ComplexBall<DoubleDouble>>) -> Self {
        Self { re: m.map(|x| x.re), im: m.map(|x| x.im) }
    }
}

impl ComplexMatrix {
    pub(super) fn zeros(rows: usize, columns: usize) -> Self {
        Self { re: ball::zeros(rows, columns), im: ball::zeros(rows, columns) }
    }

    pub(super) fn product(&self, other: &Self) -> Self {
        let of = ball::product;
        Self {
            re: of(&self.re, &other.re) - of(&self.im, &other.im),
            im: of(&self.re, &other.im) + of(&self.im, &other.re),
        }
    }

    pub(super) fn adjoint(&self) -> Self {
        Self { re: self.re.transpose(), im: self.im.transpose().map(|x| -x) }
    }

    pub(super) fn select(&self, rows: &[usize], columns: &[usize]) -> Self {
        let part = |m: &Matrix| Matrix::from_fn(rows.len(), columns.len(), |i, j| m[(rows[i], columns[j])]);
        Self { re: part(&self.re), im: part(&self.im) }
    }

    /// A Hermitian matrix as the real symmetric one of twice the order that acts on (re, im).
    pub(super) fn realified(&self) -> Matrix {
        let n = self.re.nrows();
        Matrix::from_fn(2 * n, 2 * n, |i, j| match (i < n, j < n) {
            (true, true) => self.re[(i, j)],
            (false, false) => self.re[(i - n, j - n)],
            (false, true) => self.im[(i - n, j)],
            (true, false) => -self.im[(i, j - n)],
        })
    }
}
