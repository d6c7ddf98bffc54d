//! All calls of the decomposition library: singular values of small and tall matrices.
//!
//! Matrices and vectors of fixed size are nalgebra's; the decompositions are faer's.

use faer::Mat;
use faer::linalg::solvers::{Solve, Svd};
use nalgebra::{Matrix3, SMatrix, SVector};

/// The thin decomposition; `None` when an entry is not finite or the iteration does not converge.
fn svd(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Option<Svd<f64>> {
    let is_finite = (0..rows).all(|i| (0..columns).all(|j| entry(i, j).is_finite()));
    is_finite.then(|| Mat::from_fn(rows, columns, entry).as_ref().thin_svd().ok())?
}

/// The right singular vector of the least singular value, and all singular values from the largest.
///
/// `rows` is any number of rows of N entries; fewer than N rows are padded with zero rows.
pub(crate) fn least_vector<const N: usize>(rows: &[[f64; N]]) -> Option<(SVector<f64, N>, [f64; N])> {
    let svd = svd(rows.len().max(N), N, |i, j| rows.get(i).map_or(0.0, |r| r[j]))?;
    let values = svd.S().column_vector();
    let vector = SVector::from_fn(|j, _| svd.V()[(j, N - 1)]);
    Some((vector, std::array::from_fn(|k| values[k])))
}

/// U, the singular values from the largest, and V of a 3 x 3 matrix: m = U diag(s) V^T.
pub(crate) fn svd3(m: &Matrix3<f64>) -> Option<(Matrix3<f64>, [f64; 3], Matrix3<f64>)> {
    let svd = svd(3, 3, |i, j| m[(i, j)])?;
    let s = svd.S().column_vector();
    let copy = |a: faer::MatRef<'_, f64>| Matrix3::from_fn(|i, j| a[(i, j)]);
    Some((copy(svd.U()), [s[0], s[1], s[2]], copy(svd.V())))
}

/// The least-squares solution of `rows` x = `rhs`, `None` when the columns are dependent (to 1e-12).
pub(crate) fn least_squares<const N: usize>(rows: &[[f64; N]], rhs: &[f64]) -> Option<SVector<f64, N>> {
    if rows.len() < N || rhs.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let svd = svd(rows.len(), N, |i, j| rows[i][j])?;
    let s = svd.S().column_vector();
    if s[N - 1] <= 1e-12 * s[0] {
        return None;
    }
    let mut solution = SVector::zeros();
    for k in 0..N {
        let along: f64 = (0..rows.len()).map(|i| svd.U()[(i, k)] * rhs[i]).sum::<f64>() / s[k];
        solution += SVector::from_fn(|j, _| svd.V()[(j, k)] * along);
    }
    Some(solution)
}

/// One step of Gauss-Newton: solves J^T J dx = J^T r by Cholesky (N is at most 12).
pub(crate) fn normal_step<const N: usize>(
    jtj: &SMatrix<f64, N, N>,
    jtr: &SVector<f64, N>,
) -> Option<SVector<f64, N>> {
    positive_solution(jtj.as_slice(), jtr.as_slice()).map(|step| SVector::from_column_slice(&step))
}

/// The solution of a positive definite system, its matrix row by row; `None` if it is not positive definite
/// or not finite.
pub(crate) fn positive_solution(matrix: &[f64], rhs: &[f64]) -> Option<Vec<f64>> {
    let side = rhs.len();
    if matrix.iter().chain(rhs).any(|v| !v.is_finite()) {
        return None;
    }
    let factor =
        Mat::from_fn(side, side, |i, j| matrix[i * side + j]).as_ref().llt(faer::Side::Lower).ok()?;
    let x = factor.solve(Mat::from_fn(side, 1, |i, _| rhs[i]));
    let found: Vec<f64> = (0..side).map(|i| x[(i, 0)]).collect();
    found.iter().all(|v| v.is_finite()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_vector_spans_the_null_space() {
        let rows = [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [1.0, 0.0, -1.0], [5.0, 5.0, 5.0]];
        let (v, s) = least_vector(&rows).unwrap();
        assert!(s[2] < 1e-14 && s[1] > 0.1);
        for row in rows {
            assert!(row.iter().zip(v.iter()).map(|(a, b)| a * b).sum::<f64>().abs() < 1e-14);
        }
        let (v, s) = least_vector(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        assert!((v[2].abs() - 1.0).abs() < 1e-15 && s[2] == 0.0);
        assert!(least_vector(&[[f64::NAN, 0.0]]).is_none());
    }

    #[test]
    fn rank_one_is_decomposed() {
        let m = Matrix3::from_element(1.0);
        let (u, s, v) = svd3(&m).unwrap();
        assert!((s[0] - 3.0).abs() < 1e-14 && s[1] < 1e-14);
        let back = u * Matrix3::from_diagonal(&s.into()) * v.transpose();
        assert!((back - m).norm() < 1e-14);
    }

    #[test]
    fn least_squares_has_an_orthogonal_residual() {
        let rows = [[1.0, 0.0], [1.0, 1.0], [1.0, 2.0], [1.0, 3.0]];
        let rhs = [1.0, 0.0, 2.0, 1.0];
        let x = least_squares(&rows, &rhs).unwrap();
        for column in 0..2 {
            let dot: f64 =
                rows.iter().zip(rhs).map(|(r, b)| r[column] * (r[0] * x[0] + r[1] * x[1] - b)).sum();
            assert!(dot.abs() < 1e-13);
        }
        assert!(least_squares(&[[1.0, 1.0], [2.0, 2.0]], &[1.0, 2.0]).is_none());
    }

    #[test]
    fn positive_systems_are_solved_and_others_refused() {
        let x = positive_solution(&[4.0, 1.0, 1.0, 3.0], &[6.0, 7.0]).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 2.0).abs() < 1e-14, "{x:?}");
        assert_eq!(positive_solution(&[1.0, 2.0, 2.0, 1.0], &[1.0, 1.0]), None);
        assert_eq!(positive_solution(&[f64::NAN], &[1.0]), None);
    }

    #[test]
    fn a_step_solves_the_normal_equations() {
        let jtj = SMatrix::<f64, 2, 2>::new(4.0, 1.0, 1.0, 3.0);
        let step = normal_step(&jtj, &SVector::<f64, 2>::new(1.0, 2.0)).unwrap();
        assert!((jtj * step - SVector::<f64, 2>::new(1.0, 2.0)).norm() < 1e-14);
        assert!(normal_step(&SMatrix::<f64, 2, 2>::zeros(), &SVector::zeros()).is_none());
    }
}
