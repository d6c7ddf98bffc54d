//! Discrete Lyapunov equations with one A and many right-hand sides.

use crate::linalg::{self, Mat};

/// Powers `A^(2^k)` until they vanish: 2^60 steps of any stable system are a steady state.
const MOST_POWERS: usize = 60;
/// A power this small has no effect on a sum in double precision (it enters squared).
const VANISHED: f64 = 1e-9;

/// Squared Smith iteration with its powers computed once.
#[derive(Debug, Clone)]
pub(super) struct Lyapunov {
    powers: Vec<Mat>,
}

impl Lyapunov {
    pub(super) fn new(a: &Mat) -> Self {
        let mut powers = vec![a.clone()];
        while powers.len() < MOST_POWERS {
            let last = &powers[powers.len() - 1];
            if last.norm() < VANISHED {
                break;
            }
            powers.push(last * last);
        }
        Self { powers }
    }

    /// X with `X - A X A' = q`.
    pub(super) fn forward(&self, q: &Mat) -> Mat {
        self.powers.iter().fold(q.clone(), |x, a| linalg::symmetric_part(&(a * &x * a.transpose())) + x)
    }

    /// P with `P - A' P A = q`.
    pub(super) fn adjoint(&self, q: &Mat) -> Mat {
        self.powers.iter().fold(q.clone(), |x, a| linalg::symmetric_part(&(a.tr_mul(&x) * a)) + x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_equations_are_solved_for_slow_poles_and_delay_lines() {
        let slow = Mat::from_row_slice(2, 2, &[0.9999, 1.0, 0.0, 0.9]);
        let delay = Mat::from_fn(7, 7, |i, j| f64::from(u8::from(i == j + 1)));
        for a in [slow, delay, Mat::zeros(3, 3)] {
            let n = a.nrows();
            let q = Mat::from_fn(n, n, |i, j| ((1 + i) * (1 + j)) as f64 + f64::from(u8::from(i == j)));
            let lyapunov = Lyapunov::new(&a);
            let (x, p) = (lyapunov.forward(&q), lyapunov.adjoint(&q));
            assert!((&x - &a * &x * a.transpose() - &q).norm() < 1e-13 * x.norm());
            assert!((&p - a.transpose() * &p * &a - &q).norm() < 1e-13 * p.norm());
        }
    }
}
