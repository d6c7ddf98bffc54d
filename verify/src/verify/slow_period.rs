//! One slow period of the analog side: the dependence of the state and of all samples of a period on the
//! previous state and on the input. The input enters only through the Gram matrix of the maps from it to
//! these numbers, because K K* depends on no more.
//!
//! For two samples at instants t_a >= t_b of the period, rows c_a, c_b, the entry of the Gram matrix is
//! `c_a e^{A (t_a - t_b)} G(t_b) c_b'`. The period ends with the latest sample; samples older than a period
//! are counted whole periods later.

use super::ball::{self, Matrix};
use super::front_ends::FrontEnds;
use super::state_transition::{EnclosedTransition, state_transition};
use super::timeline::{SamplingInstant, between, delay_periods};
use crate::arithmetic::{DoubleDouble, Float};
use hybank_core::units::{GridTime, Timeline};

/// x+ = transition x + w, and for each sample s: s = outputs x + v, counted `delay_periods` slow periods
/// later.
#[derive(Debug, Clone)]
pub(super) struct SlowPeriod<F = DoubleDouble> {
    /// e^{A M}.
    pub(super) transition: Matrix<F>,
    /// One row per sample.
    pub(super) outputs: Matrix<F>,
    /// Gram matrix of (w, v), states first.
    pub(super) gram: Matrix<F>,
    /// For each sample.
    pub(super) delay_periods: Vec<usize>,
}

impl<F: Float> SlowPeriod<F> {
    /// Follows `front_ends` through the period of `timeline` with `samples`.
    pub(super) fn new(front_ends: &FrontEnds, timeline: &Timeline, samples: &[SamplingInstant]) -> Self {
        let (a, b) = front_ends.dynamics();
        let instants = timeline.instants();
        let from_start = |&time| state_transition(&a, &b, between(timeline.start(), time));
        let since_start: Vec<EnclosedTransition<F>> = instants.iter().map(from_start).collect();
        let rows: Vec<Matrix<F>> = samples.iter().map(|sample| front_ends.output(sample)).collect();
        let n = front_ends.order();
        let mut outputs = ball::zeros(samples.len(), n);
        for (i, row) in rows.iter().enumerate() {
            outputs.set_row(i, &ball::product(row, &since_start[timeline.of(i)].transition).row(0));
        }
        // The latest sample ends the period.
        let end = &since_start[since_start.len() - 1];
        let mut gram = ball::zeros(n + samples.len(), n + samples.len());
        gram.view_mut((0, 0), (n, n)).copy_from(&end.gramian);
        let transition = |pair: &[GridTime]| state_transition(&a, &b, between(pair[0], pair[1])).transition;
        let between: Vec<Matrix<F>> = instants.windows(2).map(transition).collect();
        correlate(&mut gram, timeline, &since_start, &between, &rows);
        let delay_periods = delay_periods(timeline);
        Self { transition: end.transition.clone(), outputs, gram: ball::symmetric(&gram), delay_periods }
    }

    /// Number of analog states.
    pub(super) fn order(&self) -> usize {
        self.transition.nrows()
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.outputs.nrows()
    }
}

/// Fills the lower triangle beyond the states: the entries of each sample with the samples at the same
/// instant or later.
fn correlate<F: Float>(
    gram: &mut Matrix<F>,
    timeline: &Timeline,
    since_start: &[EnclosedTransition<F>],
    between: &[Matrix<F>],
    rows: &[Matrix<F>],
) {
    let n = gram.nrows() - rows.len();
    for (b, row) in rows.iter().enumerate() {
        // Covariance of the state at a later instant with sample b.
        let mut common = ball::product_transposed(&since_start[timeline.of(b)].gramian, row);
        for k in timeline.of(b)..timeline.instants().len() {
            if k > timeline.of(b) {
                common = ball::product(&between[k - 1], &common);
            }
            for a in (0..rows.len()).filter(|&a| timeline.of(a) == k) {
                let value = ball::product(&rows[a], &common)[(0, 0)];
                gram[(n + a.max(b), n + a.min(b))] = value;
            }
        }
        for i in 0..n {
            gram[(n + b, i)] = common[(i, 0)];
        }
    }
}
