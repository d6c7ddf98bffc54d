//! The weights of the regressors, by least squares with weights that are not negative.

use super::regressors::{REGRESSORS, Regressors};

/// Rounds of the coordinate descent; it converges by a factor of a few per round.
const ROUNDS: usize = 200;

/// Weights c_k >= 0 that minimise the sum over the pixels of
///
/// ```text
/// (target - sum_k c_k x_k)^2 + strength sum_k (c_k - prior_k)^2
/// ```
///
/// by coordinate descent on the normal equations. The second term decides for regressors that hardly occur.
#[derive(Debug, Clone, Default)]
pub(super) struct LeastSquares {
    matrix: [[f64; REGRESSORS]; REGRESSORS],
    right: [f64; REGRESSORS],
    count: f64,
}

impl LeastSquares {
    /// Adds one pixel.
    pub(super) fn add(&mut self, x: &Regressors, target: f64) {
        for k in 0..REGRESSORS {
            for l in 0..REGRESSORS {
                self.matrix[k][l] += x[k] * x[l];
            }
            self.right[k] += x[k] * target;
        }
        self.count += 1.0;
    }

    /// The weights; those of causes that never occurred are the priors.
    pub(super) fn solve(&self, prior: &Regressors, strength: f64) -> Regressors {
        let mut weights = *prior;
        for _ in 0..ROUNDS {
            for k in 0..REGRESSORS {
                let own = self.matrix[k][k];
                let hold = strength * self.count;
                if own + hold <= 0.0 {
                    continue;
                }
                let others: f64 =
                    (0..REGRESSORS).filter(|l| *l != k).map(|l| self.matrix[k][l] * weights[l]).sum();
                weights[k] = ((self.right[k] - others + hold * prior[k]) / (own + hold)).max(0.0);
            }
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_found_and_never_negative() {
        let truth = [0.5, 1.0, 0.0, 0.3, 2.0, 0.0];
        let mut squares = LeastSquares::default();
        for i in 0..500_u32 {
            let x: Regressors =
                std::array::from_fn(|k| if k == 5 { 0.0 } else { f64::from((i * (2 * k as u32 + 3)) % 17) });
            let pull = if i % 2 == 0 { -0.2 } else { 0.2 };
            squares.add(&x, x.iter().zip(truth).map(|(x, t)| x * t).sum::<f64>() + pull);
        }
        let got = squares.solve(&[0.7; REGRESSORS], 0.0);
        assert!(got.iter().all(|w| *w >= 0.0) && got[5] == 0.7, "{got:?}");
        assert!(got.iter().zip(truth).take(5).all(|(g, t)| (g - t).abs() < 0.02), "{got:?}");
    }
}
