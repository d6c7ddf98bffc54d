//! Dense matrices of numbers of extended precision and of balls, for which no library offers decompositions,
//! and limits by doubling: each step squares the number of steps that it covers.

use super::Float;
use super::real::MatrixEntry;
use nalgebra::DMatrix as Matrix;

/// Maximum number of doublings: 2^40 steps.
const DOUBLINGS: usize = 40;
/// Relative change of the diagonal at which a limit is reached: below the rounding of the doubles to which
/// results are rounded in the end, and above that of 106 bits.
const LIMIT_ACCURACY: f64 = 1e-25;

/// a b. Entries of `a` that are exactly zero are skipped, because delay lines are sparse.
pub fn product<T: MatrixEntry>(a: &Matrix<T>, b: &Matrix<T>) -> Matrix<T> {
    assert_eq!(a.ncols(), b.nrows(), "the matrices of a product fit each other");
    let mut result = zeros(a.nrows(), b.ncols());
    for i in 0..a.nrows() {
        let row: Vec<(usize, T)> =
            (0..a.ncols()).map(|k| (k, a[(i, k)])).filter(|(_, x)| *x != T::default()).collect();
        for j in 0..b.ncols() {
            result[(i, j)] = row.iter().fold(T::default(), |sum, &(k, x)| sum + x * b[(k, j)]);
        }
    }
    result
}

/// All entries zero.
pub fn zeros<T: MatrixEntry>(rows: usize, columns: usize) -> Matrix<T> {
    Matrix::from_element(rows, columns, T::default())
}

/// Ones on the diagonal.
pub fn identity<T: MatrixEntry>(order: usize) -> Matrix<T> {
    Matrix::from_fn(order, order, |i, j| T::from(f64::from(u8::from(i == j))))
}

/// The rows and columns with these indices.
pub fn select<T: MatrixEntry>(m: &Matrix<T>, rows: &[usize], columns: &[usize]) -> Matrix<T> {
    Matrix::from_fn(rows.len(), columns.len(), |i, j| m[(rows[i], columns[j])])
}

/// The same with the lower triangle copied into the upper one. Both must enclose the same numbers.
pub fn symmetric<T: MatrixEntry>(m: &Matrix<T>) -> Matrix<T> {
    Matrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i.max(j), i.min(j))])
}

/// m s m' for a symmetric s, with the sparse factor on the left of both products.
pub fn congruence<T: MatrixEntry>(m: &Matrix<T>, s: &Matrix<T>) -> Matrix<T> {
    symmetric(&product(m, &product(m, s).transpose()))
}

/// m^-1 rhs by elimination with row pivoting; `None` if a pivot is zero.
pub fn solve<F: Float>(m: &Matrix<F>, rhs: &Matrix<F>) -> Option<Matrix<F>> {
    let (mut left, mut right) = (m.clone(), rhs.clone());
    let n = left.nrows();
    for k in 0..n {
        let size = |i: usize| left[(i, k)].nearest().abs();
        let pivot = (k..n).max_by(|&i, &j| size(i).total_cmp(&size(j)))?;
        if size(pivot) == 0.0 || !size(pivot).is_finite() {
            return None;
        }
        left.swap_rows(k, pivot);
        right.swap_rows(k, pivot);
        for i in k + 1..n {
            let factor = left[(i, k)] / left[(k, k)];
            subtract_row(&mut left, i, factor, k, k);
            subtract_row(&mut right, i, factor, k, 0);
        }
    }
    Some(back_substituted(&left, right))
}

/// Row i minus factor times row k, from column `from` on.
fn subtract_row<F: Float>(m: &mut Matrix<F>, i: usize, factor: F, k: usize, from: usize) {
    if factor == F::ZERO {
        return;
    }
    for j in from..m.ncols() {
        m[(i, j)] = m[(i, j)] - factor * m[(k, j)];
    }
}

/// U^-1 rhs for an upper triangular U.
fn back_substituted<F: Float>(upper: &Matrix<F>, mut rhs: Matrix<F>) -> Matrix<F> {
    for k in (0..rhs.nrows()).rev() {
        for j in 0..rhs.ncols() {
            let known = (k + 1..rhs.nrows()).fold(rhs[(k, j)], |sum, i| sum - upper[(k, i)] * rhs[(i, j)]);
            rhs[(k, j)] = known / upper[(k, k)];
        }
    }
    rhs
}

/// L^-1 rhs for a lower triangular L, whose diagonal has no zeros.
pub fn solve_lower<F: Float>(lower: &Matrix<F>, rhs: &Matrix<F>) -> Matrix<F> {
    let mut x = rhs.clone();
    for i in 0..lower.nrows() {
        for j in 0..x.ncols() {
            let rest = (0..i).fold(x[(i, j)], |sum, k| sum - lower[(i, k)] * x[(k, j)]);
            x[(i, j)] = rest / lower[(i, i)];
        }
    }
    x
}

/// The lower triangular L with L L' = m, of which the lower triangle is read; `None` at the first pivot that
/// is not positive.
pub fn cholesky<F: Float>(m: &Matrix<F>) -> Option<Matrix<F>> {
    let n = m.nrows();
    // L', so that the rows of L are contiguous.
    let mut upper = zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            let (row, above) = (&upper.as_slice()[i * n..], &upper.as_slice()[j * n..]);
            let rest = row[..j].iter().zip(&above[..j]).fold(m[(i, j)], |sum, (&x, &y)| sum - x * y);
            if i > j {
                upper[(j, i)] = rest / above[j];
            } else if rest.nearest() > 0.0 && rest.nearest().is_finite() {
                upper[(i, i)] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(upper.transpose())
}

/// The pivots of the elimination without pivoting, in their order. By Sylvester's law a symmetric matrix has
/// as many negative eigenvalues as negative pivots.
pub fn pivots<F: Float>(m: &Matrix<F>) -> Vec<F> {
    let mut m = m.clone();
    for k in 0..m.nrows() {
        for i in k + 1..m.nrows() {
            let factor = m[(i, k)] / m[(k, k)];
            subtract_row(&mut m, i, factor, k, k);
        }
    }
    (0..m.nrows()).map(|k| m[(k, k)]).collect()
}

/// The limit of X+ = F X (I + G X)^-1 F' + H from X = 0 by the structure-preserving doubling algorithm
/// (E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, *Structure-preserving algorithms for periodic
/// discrete-time algebraic Riccati equations*, Int. J. Control 77, 2004). With G = 0 it is the sum of
/// F^k H F'^k, the Gramian of a stable F. `None` without convergence.
pub fn riccati_limit<F: Float>(f: &Matrix<F>, g: &Matrix<F>, h: &Matrix<F>) -> Option<Matrix<F>> {
    let (mut a, mut g, mut h) = (f.transpose(), g.clone(), h.clone());
    for _ in 0..DOUBLINGS {
        let w = identity(a.nrows()) + product(&g, &h);
        let (wa, wg) = (solve(&w, &a)?, solve(&w, &g)?);
        let more = symmetric(&product(&a.transpose(), &product(&h, &wa)));
        g = symmetric(&(g + product(&a, &product(&wg, &a.transpose()))));
        a = product(&a, &wa);
        // Only the diagonal counts: it bounds the other entries of a semidefinite change.
        let size = |m: &Matrix<F>, i: usize| m[(i, i)].nearest().abs();
        let done = (0..h.nrows()).all(|i| size(&more, i) <= LIMIT_ACCURACY * size(&h, i));
        h += more;
        if done {
            return Some(h);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::super::{DoubleDouble, Float512};
    use super::*;

    /// 1 / (i + j + 1): the condition number for n = 12 is 2e16, beyond double precision.
    fn hilbert<F: Float>(n: usize) -> Matrix<F> {
        Matrix::from_fn(n, n, |i, j| F::from(1.0) / F::from((i + j + 1) as f64))
    }

    fn size<F: Float>(m: &Matrix<F>) -> f64 {
        m.iter().map(|x| x.nearest().abs()).fold(0.0, f64::max)
    }

    fn distance<F: Float>(a: &Matrix<F>, b: &Matrix<F>) -> f64 {
        size(&(a - b))
    }

    fn inverses_are_integers<F: Float>(accuracy: f64) {
        let n = 12;
        let inverse = solve(&hilbert::<F>(n), &identity(n)).unwrap();
        // The corners of the inverse: n^2, and the sum's alternating sign.
        assert!((inverse[(0, 0)] - F::from(144.0)).nearest().abs() < accuracy);
        assert!((inverse[(0, 1)] + F::from(10296.0)).nearest().abs() < 1e3 * accuracy);
        assert!(distance(&product(&hilbert::<F>(n), &inverse), &identity(n)) < 1e3 * accuracy);
    }

    #[test]
    fn hilbert_matrices_are_inverted() {
        inverses_are_integers::<DoubleDouble>(1e-10);
        inverses_are_integers::<Float512>(1e-130);
    }

    #[test]
    fn the_factor_of_cholesky_multiplies_back_and_solves() {
        let m = hilbert::<Float512>(15);
        let l = cholesky(&m).unwrap();
        assert!(distance(&product(&l, &l.transpose()), &m) < 1e-140);
        let x = solve_lower(&l, &m);
        assert!(distance(&x, &l.transpose()) < 1e-100);
        let indefinite = &m - (identity::<Float512>(15) + identity(15));
        assert!(cholesky(&indefinite).is_none());
        assert_eq!(pivots(&indefinite).iter().filter(|pivot| pivot.nearest() < 0.0).count(), 15);
        assert!(pivots(&m).iter().all(|pivot| pivot.nearest() > 0.0));
    }

    #[test]
    fn rows_are_exchanged_where_a_pivot_is_zero_and_singular_matrices_are_none() {
        let entry = |i: usize, j: usize| DoubleDouble::from(f64::from(u8::from((i + 1) % 3 == j)));
        let shift = Matrix::from_fn(3, 3, entry);
        assert_eq!(solve(&shift, &identity(3)).unwrap(), shift.transpose());
        assert_eq!(solve(&zeros::<DoubleDouble>(2, 2), &identity(2)), None);
    }

    #[test]
    fn congruences_are_products() {
        let a = Matrix::from_fn(2, 3, |i, j| DoubleDouble::from((i * 3 + j) as f64 - 2.0));
        let s = hilbert::<DoubleDouble>(3);
        assert!(distance(&congruence(&a, &s), &product(&product(&a, &s), &a.transpose())) < 1e-30);
    }

    fn wave(rows: usize, columns: usize, step: f64) -> Matrix<Float512> {
        Matrix::from_fn(rows, columns, |i, j| Float512::from(0.4 * (step * (3 * i + 5 * j + 1) as f64).sin()))
    }

    #[test]
    fn the_gramian_solves_its_equation() {
        let (a, b) = (wave(5, 5, 1.3), wave(5, 2, 0.7));
        let squares = product(&b, &b.transpose());
        let x = riccati_limit(&a, &zeros(5, 5), &squares).unwrap();
        let residual = congruence(&a, &x) + squares - &x;
        assert!(size(&residual) < 1e-40 * size(&x), "{:e}", size(&residual));
        let unstable = identity::<Float512>(1);
        assert!(riccati_limit(&unstable, &zeros(1, 1), &unstable).is_none());
    }

    #[test]
    fn the_limit_is_a_fixed_point_of_the_recursion() {
        let (f, c, b) = (wave(4, 4, 1.1), wave(2, 4, 0.3), wave(4, 2, 2.1));
        let (g, h) = (symmetric(&product(&c.transpose(), &c)), product(&b, &b.transpose()));
        let x = riccati_limit(&f, &g, &h).unwrap();
        let w = solve(&(identity(4) + product(&g, &x)), &f.transpose()).unwrap();
        let residual = product(&f, &product(&x, &w)) + h - &x;
        assert!(size(&residual) < 1e-40 * size(&x), "{:e}", size(&residual));
    }
}
