//! Small linear problems of vectors of fixed size.

use crate::{Mat, Svd, svd};
use nalgebra::{Matrix3, SVector};

/// The thin decomposition of rows, padded with zero rows up to `least`; `None` when an entry is not finite
/// or the iteration does not converge.
fn decomposed<const N: usize>(rows: &[[f64; N]], least: usize) -> Option<Svd> {
    let entry = |i: usize, j: usize| rows.get(i).map_or(0.0, |row| row[j]);
    svd(&Mat::from_fn(rows.len().max(least), N, entry)).ok()
}

/// The right singular vector of the least singular value, and all singular values from the largest.
///
/// `rows` is any number of rows of N entries; fewer than N rows are padded with zero rows.
pub fn least_vector<const N: usize>(rows: &[[f64; N]]) -> Option<(SVector<f64, N>, [f64; N])> {
    let Svd { s, v, .. } = decomposed(rows, N)?;
    Some((SVector::from_fn(|j, _| v[(j, N - 1)]), std::array::from_fn(|k| s[k])))
}

/// U, the singular values from the largest, and V of a 3 x 3 matrix: m = U diag(s) V^T.
pub fn svd3(m: &Matrix3<f64>) -> Option<(Matrix3<f64>, [f64; 3], Matrix3<f64>)> {
    let Svd { u, s, v } = svd(&Mat::from_column_slice(3, 3, m.as_slice())).ok()?;
    let fixed = |m: &Mat| Matrix3::from_column_slice(m.as_slice());
    Some((fixed(&u), [s[0], s[1], s[2]], fixed(&v)))
}

/// The least-squares solution of `rows` x = `rhs`, `None` when the columns are dependent (to 1e-12).
pub fn least_squares<const N: usize>(rows: &[[f64; N]], rhs: &[f64]) -> Option<SVector<f64, N>> {
    if rows.len() < N || rhs.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let Svd { u, s, v } = decomposed(rows, N)?;
    let along = |k: usize| u.column(k).iter().zip(rhs).map(|(u, r)| u * r).sum::<f64>() / s[k];
    let along: [f64; N] = std::array::from_fn(along);
    let solution = SVector::from_fn(|j, _| (0..N).map(|k| v[(j, k)] * along[k]).sum());
    (s[N - 1] > 1e-12 * s[0]).then_some(solution)
}
