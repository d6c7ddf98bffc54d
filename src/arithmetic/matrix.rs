//! Dense matrices of numbers of extended precision, for which no library offers decompositions.

use super::Number;
use std::ops::{Add, Index, IndexMut, Mul, Sub};

/// A dense matrix, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Matrix<F> {
    columns: usize,
    rows: Vec<Vec<F>>,
}

impl<F: Number> Matrix<F> {
    pub(crate) fn from_fn(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> F) -> Self {
        let row = |i: usize| (0..columns).map(|j| entry(i, j)).collect();
        Self { columns, rows: (0..rows).map(row).collect() }
    }

    pub(crate) fn zeros(rows: usize, columns: usize) -> Self {
        Self::from_fn(rows, columns, |_, _| F::ZERO)
    }

    pub(crate) fn identity(order: usize) -> Self {
        Self::from_fn(order, order, |i, j| F::from(f64::from(u8::from(i == j))))
    }

    pub(crate) fn nrows(&self) -> usize {
        self.rows.len()
    }

    pub(crate) fn ncols(&self) -> usize {
        self.columns
    }

    pub(crate) fn transpose(&self) -> Self {
        Self::from_fn(self.ncols(), self.nrows(), |i, j| self[(j, i)])
    }

    /// The rows and columns with these indices.
    pub(crate) fn select(&self, rows: &[usize], columns: &[usize]) -> Self {
        Self::from_fn(rows.len(), columns.len(), |i, j| self[(rows[i], columns[j])])
    }

    /// The rows with these indices.
    pub(crate) fn select_rows(&self, rows: &[usize]) -> Self {
        Self { columns: self.columns, rows: rows.iter().map(|&i| self.rows[i].clone()).collect() }
    }

    /// The same with the lower triangle copied into the upper one.
    pub(crate) fn symmetric(&self) -> Self {
        Self::from_fn(self.nrows(), self.ncols(), |i, j| self[(i.max(j), i.min(j))])
    }

    /// self s self' for a symmetric s.
    pub(crate) fn congruence(&self, s: &Self) -> Self {
        (self * &(self * s).transpose()).symmetric()
    }

    /// self^-1 rhs by elimination with row pivoting; `None` if a pivot is zero.
    pub(crate) fn solve(&self, rhs: &Self) -> Option<Self> {
        let (mut left, mut right) = (self.clone(), rhs.clone());
        let n = left.nrows();
        for k in 0..n {
            let size = |i: usize| left[(i, k)].nearest().abs();
            let pivot = (k..n).max_by(|&i, &j| size(i).total_cmp(&size(j)))?;
            if size(pivot) == 0.0 || !size(pivot).is_finite() {
                return None;
            }
            left.rows.swap(k, pivot);
            right.rows.swap(k, pivot);
            for i in k + 1..n {
                let factor = left[(i, k)] / left[(k, k)];
                left.subtract_row(i, factor, k, k);
                right.subtract_row(i, factor, k, 0);
            }
        }
        Some(left.back_substituted(right))
    }

    /// Row i minus factor times row k, from column `from` on.
    fn subtract_row(&mut self, i: usize, factor: F, k: usize, from: usize) {
        if factor == F::ZERO {
            return;
        }
        for j in from..self.columns {
            self[(i, j)] = self[(i, j)] - factor * self[(k, j)];
        }
    }

    /// U^-1 rhs with the upper triangle U of this matrix.
    fn back_substituted(&self, mut rhs: Self) -> Self {
        let n = self.nrows();
        for k in (0..n).rev() {
            for j in 0..rhs.ncols() {
                let known = (k + 1..n).fold(rhs[(k, j)], |sum, i| sum - self[(k, i)] * rhs[(i, j)]);
                rhs[(k, j)] = known / self[(k, k)];
            }
        }
        rhs
    }

    /// The lower triangular L with L L' = self; `None` if this matrix is not positive definite.
    pub(crate) fn cholesky(&self) -> Option<Self> {
        let n = self.nrows();
        let mut l = Self::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                let rest = (0..j).fold(self[(i, j)], |sum, k| sum - l[(i, k)] * l[(j, k)]);
                if i > j {
                    l[(i, j)] = rest / l[(j, j)];
                } else if rest.nearest() > 0.0 && rest.nearest().is_finite() {
                    l[(i, i)] = rest.sqrt();
                } else {
                    return None;
                }
            }
        }
        Some(l)
    }

    /// L^-1 rhs for this lower triangular matrix L, whose diagonal has no zeros.
    pub(crate) fn solve_lower(&self, rhs: &Self) -> Self {
        let mut x = rhs.clone();
        for i in 0..self.nrows() {
            for j in 0..x.ncols() {
                let rest = (0..i).fold(x[(i, j)], |sum, k| sum - self[(i, k)] * x[(k, j)]);
                x[(i, j)] = rest / self[(i, i)];
            }
        }
        x
    }

    /// The pivots of the elimination without pivoting, in their order. By Sylvester's law a symmetric matrix
    /// has as many negative eigenvalues as negative pivots.
    pub(crate) fn pivots(&self) -> Vec<F> {
        let mut m = self.clone();
        for k in 0..m.nrows() {
            for i in k + 1..m.nrows() {
                let factor = m[(i, k)] / m[(k, k)];
                m.subtract_row(i, factor, k, k);
            }
        }
        (0..m.nrows()).map(|k| m[(k, k)]).collect()
    }
}

impl<F> Index<(usize, usize)> for Matrix<F> {
    type Output = F;
    fn index(&self, (i, j): (usize, usize)) -> &F {
        &self.rows[i][j]
    }
}

impl<F> IndexMut<(usize, usize)> for Matrix<F> {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut F {
        &mut self.rows[i][j]
    }
}

impl<F: Number> Add for &Matrix<F> {
    type Output = Matrix<F>;
    fn add(self, other: Self) -> Matrix<F> {
        Matrix::from_fn(self.nrows(), self.ncols(), |i, j| self[(i, j)] + other[(i, j)])
    }
}

impl<F: Number> Sub for &Matrix<F> {
    type Output = Matrix<F>;
    fn sub(self, other: Self) -> Matrix<F> {
        Matrix::from_fn(self.nrows(), self.ncols(), |i, j| self[(i, j)] - other[(i, j)])
    }
}

impl<F: Number> Mul for &Matrix<F> {
    type Output = Matrix<F>;
    /// Zeros on the left are skipped, because delay lines are sparse.
    fn mul(self, other: Self) -> Matrix<F> {
        let row = |i: usize| -> Vec<F> {
            let mut sums = vec![F::ZERO; other.ncols()];
            for (&x, factors) in self.rows[i].iter().zip(&other.rows) {
                if x != F::ZERO {
                    sums.iter_mut().zip(factors).for_each(|(sum, &y)| *sum = *sum + x * y);
                }
            }
            sums
        };
        Matrix { columns: other.columns, rows: (0..self.nrows()).map(row).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{BigFloat, DoubleDouble};
    use super::*;

    /// 1 / (i + j + 1): the condition number for n = 12 is 2e16, beyond double precision.
    fn hilbert<F: Number>(n: usize) -> Matrix<F> {
        Matrix::from_fn(n, n, |i, j| F::from(1.0) / F::from((i + j + 1) as f64))
    }

    fn distance<F: Number>(a: &Matrix<F>, b: &Matrix<F>) -> f64 {
        let gap = a - b;
        let entries = (0..gap.nrows()).flat_map(|i| (0..gap.ncols()).map(move |j| (i, j)));
        entries.map(|at| gap[at].nearest().abs()).fold(0.0, f64::max)
    }

    fn inverses_are_integers<F: Number>(accuracy: f64) {
        let n = 12;
        let inverse = hilbert::<F>(n).solve(&Matrix::identity(n)).unwrap();
        // The corners of the inverse: n^2, and the sum's alternating sign.
        assert!((inverse[(0, 0)] - F::from(144.0)).nearest().abs() < accuracy);
        assert!((inverse[(0, 1)] + F::from(10296.0)).nearest().abs() < 1e3 * accuracy);
        assert!(distance(&(&hilbert::<F>(n) * &inverse), &Matrix::identity(n)) < 1e3 * accuracy);
    }

    #[test]
    fn hilbert_matrices_are_inverted() {
        inverses_are_integers::<DoubleDouble>(1e-10);
        inverses_are_integers::<BigFloat>(1e-130);
    }

    #[test]
    fn the_factor_of_cholesky_multiplies_back_and_solves() {
        let m = hilbert::<BigFloat>(15);
        let l = m.cholesky().unwrap();
        assert!(distance(&(&l * &l.transpose()), &m) < 1e-140);
        let x = l.solve_lower(&m);
        assert!(distance(&x, &l.transpose()) < 1e-100);
        let indefinite = &m - &(&Matrix::identity(15) + &Matrix::identity(15));
        assert!(indefinite.cholesky().is_none());
        assert_eq!(indefinite.pivots().iter().filter(|pivot| pivot.nearest() < 0.0).count(), 15);
        assert!(m.pivots().iter().all(|pivot| pivot.nearest() > 0.0));
    }

    #[test]
    fn rows_are_exchanged_where_a_pivot_is_zero_and_singular_matrices_are_none() {
        let entry = |i: usize, j: usize| DoubleDouble::from(f64::from(u8::from((i + 1) % 3 == j)));
        let turn = Matrix::from_fn(3, 3, entry);
        let back = turn.solve(&Matrix::identity(3)).unwrap();
        assert_eq!(back, turn.transpose());
        assert_eq!(Matrix::<DoubleDouble>::zeros(2, 2).solve(&Matrix::identity(2)), None);
    }

    #[test]
    fn congruences_are_products() {
        let a = Matrix::from_fn(2, 3, |i, j| DoubleDouble::from((i * 3 + j) as f64 - 2.0));
        let s = hilbert::<DoubleDouble>(3);
        assert!(distance(&a.congruence(&s), &(&(&a * &s) * &a.transpose())) < 1e-30);
    }
}
