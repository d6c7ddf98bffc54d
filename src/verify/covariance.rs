//! Covariance of the analog state for white noise at the input.

use super::ball::{self, Matrix};
use super::slow_period::SlowPeriod;
use crate::arithmetic::{DoubleDouble, Number};

/// Remainder of the sum over the past, relative to the rounding error of an operation.
const NEGLIGIBLE_REMAINDER: f64 = 1e-9;
/// 2^64 slow periods bring any stable filter to its steady state.
const DOUBLINGS: usize = 64;
/// Makes up for the roundings of the remainder's bound, sums of as many terms as there are states.
const REMAINDER_OUTWARD: f64 = 1.01;

/// X = E X E' + G by doubling, for noise of unit density; the remainder after 2^k steps is at most
/// ||E^(2^k)||^2 of the whole. `None` for filters that are not stable.
pub(super) fn covariance(period: &SlowPeriod) -> Option<Matrix> {
    let n = period.order();
    let mut state = period.gram.view((0, 0), (n, n)).into_owned();
    let mut power = period.transition.clone();
    for _ in 0..DOUBLINGS {
        let size = ball::row_sum(&power) * ball::row_sum(&power.transpose());
        if size < DoubleDouble::ROUNDING * NEGLIGIBLE_REMAINDER {
            let rest = REMAINDER_OUTWARD * ball::row_sum(&state) * size;
            return Some(state.map(|x| x.widened(rest)));
        }
        state += ball::congruence(&power, &state);
        power = ball::product(&power, &power);
    }
    None
}
