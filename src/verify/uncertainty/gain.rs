//! Proven bounds of a gain: the root of the largest eigenvalue of K K*.

use super::super::ball::{self, Matrix};
use super::super::positive;
use super::super::spectrum::ComplexMatrix;
use crate::arithmetic::Ball;
use crate::linalg;

/// Relative margins over a computed eigenvalue at which a proof that it is an upper bound is tried.
const MARGINS: [f64; 4] = [1e-9, 1e-6, 1e-3, 1.0];

/// A proven upper bound of the root of the largest eigenvalue; at least tries to prove `wanted` if the
/// eigenvalue is below.
pub(super) fn upper_gain(square: &ComplexMatrix, wanted: f64) -> f64 {
    let real = square.realified();
    let Ok(values) = linalg::hermitian_eigenvalues(&ball::nearest(&real)) else { return f64::INFINITY };
    let largest = values.into_iter().fold(0.0, f64::max);
    let exceeds = |bound: f64| {
        let shifted = Matrix::from_fn(real.nrows(), real.nrows(), |i, j| {
            let entry = -real[(i, j)];
            if i == j { entry + Ball::from(bound) } else { entry }
        });
        positive::exceeds(&shifted, 0.0)
    };
    let tight = wanted * wanted * (1.0 - 1e-14);
    let tried = MARGINS.iter().map(|margin| largest * (1.0 + margin) + f64::MIN_POSITIVE);
    let enough = (wanted > 0.0 && largest < tight).then_some(tight);
    let proven = enough.into_iter().chain(tried).find(|&bound| exceeds(bound));
    proven.map_or(f64::INFINITY, |bound| bound.sqrt() * (1.0 + 1e-15))
}

/// A proven lower bound of the same: the quotient of a direction near the eigenvector.
pub(super) fn lower_gain(square: &ComplexMatrix) -> f64 {
    let real = square.realified();
    let Ok((values, vectors)) = linalg::symmetric_eigen(&ball::nearest(&real)) else { return 0.0 };
    let Some(k) = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])) else { return 0.0 };
    let direction: Matrix = ball::exact(&vectors.columns(k, 1).into_owned());
    let transposed = direction.transpose();
    let energy = ball::product(&transposed, &ball::product(&real, &direction))[(0, 0)];
    let quotient = (energy / ball::product(&transposed, &direction)[(0, 0)]).lower();
    if quotient > 0.0 { quotient.sqrt() * (1.0 - 1e-15) } else { 0.0 }
}
