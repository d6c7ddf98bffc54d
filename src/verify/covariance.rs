//! Covariance of the analog state for white noise at the input.

use super::ball::{self, Matrix};
use crate::arithmetic::Number;

/// Remainder of the sum over the past, relative to the rounding error of an operation.
const NEGLIGIBLE_REMAINDER: f64 = 1e-9;
/// 2^64 slow periods bring any stable filter to its steady state.
const DOUBLINGS: usize = 64;
/// Makes up for the roundings of the remainder's bound, sums of as many terms as there are states.
const REMAINDER_OUTWARD: f64 = 1.01;

/// X = E X E' + G by doubling; the remainder after 2^k steps is at most ||E^(2^k)||^2 of the whole.
/// `None` if E is not seen to be stable.
pub(super) fn steady_state<F: Number>(transition: &Matrix<F>, gramian: &Matrix<F>) -> Option<Matrix<F>> {
    let (mut state, mut power) = (gramian.clone(), transition.clone());
    for _ in 0..DOUBLINGS {
        let size = ball::row_sum(&power) * ball::row_sum(&power.transpose());
        if size < F::ROUNDING * NEGLIGIBLE_REMAINDER {
            let rest = REMAINDER_OUTWARD * ball::row_sum(&state) * size;
            return Some(state.map(|x| x.widened(rest)));
        }
        state += ball::congruence(&power, &state);
        power = ball::product(&power, &power);
    }
    None
}
