//! Covariances of the samples for white noise at the input.

use super::ball::{self, Ball, Matrix};
use super::slow_period::SlowPeriod;
use crate::arithmetic::{DoubleDouble, Number};

/// Remainder of the sum over the past, relative to the rounding error of an operation.
const NEGLIGIBLE_REMAINDER: f64 = 1e-9;

/// The samples that the taps of one output weight: those of distinct channels over whole periods.
#[derive(Debug, Clone, Copy)]
pub(super) struct TapSamples<'a> {
    /// M.
    pub(super) ratio: usize,
    /// The channels, from 0.
    pub(super) channels: &'a [usize],
    /// Periods, K.
    pub(super) lags: usize,
}

/// 2^64 slow periods bring any stable filter to its steady state.
const DOUBLINGS: usize = 64;
/// Makes up for the roundings of the remainder's bound, sums of as many terms as there are states.
const REMAINDER_OUTWARD: f64 = 1.01;

/// Second moments of the samples for white noise of unit density at the input.
pub(super) struct Covariance<F = DoubleDouble> {
    /// Of the analog state.
    state: Matrix<F>,
    /// e^{A M}.
    transition: Matrix<F>,
}

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

impl<F: Number> Covariance<F> {
    /// `None` if the front ends are not seen to be stable.
    pub(super) fn new(period: &SlowPeriod<F>) -> Option<Self> {
        let n = period.order();
        let gramian = period.gram.view((0, 0), (n, n)).into_owned();
        let state = steady_state(&period.transition, &gramian)?;
        Some(Self { state, transition: period.transition.clone() })
    }

    /// E s_a[k + lag] s_b[k], samples counted at the period in which they are taken.
    fn entry(&self, period: &SlowPeriod<F>, (a, b): (usize, usize), lags: usize) -> Vec<Ball<F>> {
        let n = period.order();
        let (row_a, row_b) = (period.outputs.rows(a, 1).into_owned(), period.outputs.rows(b, 1).into_owned());
        let before = ball::product_transposed(&self.state, &row_b);
        let mut values = vec![ball::product(&row_a, &before)[(0, 0)] + period.gram[(n + a, n + b)]];
        let mut common = ball::product(&self.transition, &before) + period.gram.view((0, n + b), (n, 1));
        for _ in 1..=lags {
            values.push(ball::product(&row_a, &common)[(0, 0)]);
            common = ball::product(&self.transition, &common);
        }
        values
    }

    /// Covariance matrix of the samples, N K x N K, the channels of the latest period first.
    pub(super) fn of_taps(&self, period: &SlowPeriod<F>, samples: TapSamples<'_>) -> Matrix<F> {
        let TapSamples { ratio, channels, lags } = samples;
        let late = |i: usize| period.delay_periods[ratio + channels[i]];
        let span = lags + (0..channels.len()).map(late).max().unwrap_or(0);
        let n = channels.len();
        let mut matrix = ball::zeros(n * lags, n * lags);
        for a in 0..n {
            for b in 0..n {
                let values = self.entry(period, (ratio + channels[a], ratio + channels[b]), span);
                for (j, k) in (0..lags).flat_map(|j| (0..lags).map(move |k| (j, k))) {
                    // Sample j periods back, taken late(a) periods earlier still.
                    let (from_a, from_b) = (j + late(a), k + late(b));
                    if from_b >= from_a {
                        let value = values[from_b - from_a];
                        matrix[(j * n + a, k * n + b)] = value;
                        matrix[(k * n + b, j * n + a)] = value;
                    }
                }
            }
        }
        matrix
    }

    /// Correlations of the M reference samples with the samples of [`Covariance::of_taps`], M x N K.
    pub(super) fn with_reference(&self, period: &SlowPeriod<F>, samples: TapSamples<'_>) -> Matrix<F> {
        let TapSamples { ratio, channels, lags } = samples;
        let late = |sample: usize| period.delay_periods[sample];
        let span = lags + period.delay_periods.iter().max().copied().unwrap_or(0);
        let mut matrix = ball::zeros(ratio, channels.len() * lags);
        for p in 0..ratio {
            for (i, sample) in channels.iter().map(|channel| ratio + channel).enumerate() {
                let (newer, older) =
                    (self.entry(period, (p, sample), span), self.entry(period, (sample, p), span));
                for j in 0..lags {
                    // The sample is taken `from_b` periods back, the reference sample `from_a`.
                    let (from_a, from_b) = (late(p), j + late(sample));
                    let value =
                        if from_b >= from_a { newer[from_b - from_a] } else { older[from_a - from_b] };
                    matrix[(p, j * channels.len() + i)] = value;
                }
            }
        }
        matrix
    }

    /// Mean square of the M reference samples of a period together.
    pub(super) fn of_reference(&self, period: &SlowPeriod<F>, ratio: usize) -> Ball<F> {
        (0..ratio).fold(Ball::ZERO, |sum, p| sum + self.entry(period, (p, p), 0)[0])
    }
}
