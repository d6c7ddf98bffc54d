//! Cholesky factors of Newton matrices, which an interior-point method makes as ill-conditioned as the
//! machine precision allows.

use super::settings::SETTINGS;
use hybank_linalg::{LinalgError, Mat, PositiveFactor};

/// The Cholesky factor of a Newton matrix, scaled to a unit diagonal, with as small a diagonal shift as it
/// needs.
#[derive(Debug)]
pub(super) struct RegularisedCholesky {
    matrix: Mat,
    scale: Vec<f64>,
    factor: PositiveFactor,
}

/// Steps of iterative refinement against the unshifted matrix.
const REFINEMENTS: usize = 2;

impl RegularisedCholesky {
    /// Factors the symmetric `matrix`, of which only the lower triangle is read.
    ///
    /// # Errors
    /// [`LinalgError`] if even the largest shift leaves the matrix indefinite.
    pub(super) fn new(mut matrix: Mat) -> Result<Self, LinalgError> {
        matrix.fill_upper_triangle_with_lower_triangle();
        let scale: Vec<f64> =
            matrix.diagonal().iter().map(|d| if *d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }).collect();
        for (j, mut column) in matrix.column_iter_mut().enumerate() {
            for (i, value) in column.iter_mut().enumerate() {
                *value *= scale[i] * scale[j];
            }
        }
        let (factor, _) = shifted_factor(&matrix)?;
        Ok(Self { matrix, scale, factor })
    }

    /// Solves with the unshifted matrix, up to the accuracy of the iterative refinement.
    pub(super) fn solve(&self, rhs: &[f64]) -> Vec<f64> {
        let mut scaled = Mat::from_column_slice(rhs.len(), 1, rhs);
        scaled.iter_mut().zip(&self.scale).for_each(|(value, s)| *value *= s);
        let mut x = self.factor.solve(&scaled);
        for _ in 0..REFINEMENTS {
            let residual = &scaled - &self.matrix * &x;
            let better = &x + self.factor.solve(&residual);
            if (&scaled - &self.matrix * &better).norm() >= residual.norm() {
                break;
            }
            x = better;
        }
        x.iter().zip(&self.scale).map(|(value, s)| value * s).collect()
    }
}

/// The factor of a matrix of unit diagonal with as small a shift of the diagonal as it needs, and that
/// shift.
fn shifted_factor(matrix: &Mat) -> Result<(PositiveFactor, f64), LinalgError> {
    let mut shift = 0.0;
    loop {
        let shifted = matrix + Mat::from_diagonal_element(matrix.nrows(), matrix.ncols(), shift);
        match PositiveFactor::new(&shifted) {
            Ok(factor) => return Ok((factor, shift)),
            Err(error) if shift >= SETTINGS.shift_last => return Err(error),
            Err(_) => shift = (shift * SETTINGS.shift_growth).max(SETTINGS.shift_first),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNITS: [f64; 2] = [1e-9, 1e9];

    /// Symmetric with eigenvalues 1 and `least`, in units that differ by 18 decades.
    fn nearly_singular(least: f64) -> Mat {
        let (u, v) = (0.6, 0.8);
        let m = Mat::from_row_slice(
            2,
            2,
            &[u * u + least * v * v, u * v * (1.0 - least), u * v * (1.0 - least), v * v + least * u * u],
        );
        Mat::from_fn(2, 2, |i, j| m[(i, j)] * UNITS[i] * UNITS[j])
    }

    #[test]
    fn the_inverse_is_right_in_any_units() {
        let matrix = nearly_singular(1e-3);
        let factor = RegularisedCholesky::new(matrix.clone()).unwrap();
        assert_eq!(shifted_factor(&factor.matrix).unwrap().1, 0.0);
        let inverse = Mat::from_vec(2, 2, [factor.solve(&[1.0, 0.0]), factor.solve(&[0.0, 1.0])].concat());
        let product = &matrix * inverse;
        let unitless = Mat::from_fn(2, 2, |i, j| product[(i, j)] * UNITS[j] / UNITS[i]);
        assert!((unitless - Mat::identity(2, 2)).norm() < 1e-11);
        let x = factor.solve(&[1e-9, 0.0]);
        let back = &matrix * Mat::from_column_slice(2, 1, &x);
        assert!((back[0] - 1e-9).abs() < 1e-21 && back[1].abs() < 1e-3, "{back}");
    }

    #[test]
    fn singular_matrices_are_shifted_a_little_and_indefinite_ones_refused() {
        let singular = RegularisedCholesky::new(nearly_singular(0.0)).unwrap();
        let (_, shift) = shifted_factor(&singular.matrix).unwrap();
        assert!(shift <= 1e-14, "{shift}");
        assert!(RegularisedCholesky::new(nearly_singular(-1e-2)).is_err());
    }
}
