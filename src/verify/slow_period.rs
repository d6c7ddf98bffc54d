//! One slow period of the analog side: the dependence of the state and of all samples of a period on the
//! previous state and on the input. The input enters only through the Gram matrix of the maps from it to
//! these numbers, because K K* depends on no more.
//!
//! For two samples at instants t_a >= t_b of the period, rows c_a, c_b, the entry of the Gram matrix is
//! `c_a e^{A (t_a - t_b)} G(t_b) c_b'`. The period ends with the latest sample; samples older than a period
//! are counted whole periods later.

use super::VerifyError;
use super::ball::{self, Ball, Matrix};
use super::front_ends::FrontEnds;
use super::state_transition::{StateTransition, state_transition};
use crate::arithmetic::{BigFloat, DoubleDouble, Number};
use crate::units::{GridTime, Timeline};

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

impl<F: Number> SlowPeriod<F> {
    /// Follows `front_ends` through the period of `timeline` with `samples`.
    pub(super) fn new(front_ends: &FrontEnds, timeline: &Timeline, samples: &[SamplingInstant]) -> Self {
        let (a, b) = front_ends.dynamics();
        let instants = timeline.instants();
        let from_start = |&time| state_transition(&a, &b, between(timeline.start(), time));
        let since_start: Vec<StateTransition<F>> = instants.iter().map(from_start).collect();
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
fn correlate<F: Number>(
    gram: &mut Matrix<F>,
    timeline: &Timeline,
    since_start: &[StateTransition<F>],
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

/// Maximum number of periods by which a sample may be late; the limit keeps the count exact in doubles.
const MAX_PERIODS_LATE: f64 = (1u64 << 40) as f64;

/// What is sampled, and when.
#[derive(Debug, Clone, Copy)]
pub(super) struct SamplingInstant {
    /// Index of the filter.
    pub(super) filter: usize,
    /// The output of the sample's own filter over that filter's, not zero.
    pub(super) gain: Ball<BigFloat>,
    /// The sample over the output of its own filter, not zero.
    pub(super) converter_gain: f64,
    pub(super) time: GridTime,
}

/// The instants of `samples` in one slow period of `ratio` fast periods.
///
/// # Errors
/// [`VerifyError::TooLate`] if a sample is later than the maximum number of periods.
pub(super) fn timeline(samples: &[SamplingInstant], ratio: usize) -> Result<Timeline, VerifyError> {
    let times: Vec<GridTime> = samples.iter().map(|sample| sample.time).collect();
    let timeline = Timeline::new(&times, ratio);
    let periods = timeline.delay_periods().iter().copied().fold(0.0, f64::max);
    if periods < MAX_PERIODS_LATE { Ok(timeline) } else { Err(VerifyError::TooLate { periods }) }
}

/// For each sample the whole slow periods from its instant to that in which it is counted.
pub(super) fn delay_periods(timeline: &Timeline) -> Vec<usize> {
    timeline.delay_periods().iter().map(|&periods| periods as usize).collect()
}

/// Encloses the time from `earlier` to `later` in fast periods; exactly zero if they are one.
pub(super) fn between<F: Number>(earlier: GridTime, later: GridTime) -> Ball<F> {
    if earlier == later {
        return Ball::ZERO;
    }
    let rest = Ball::from(later.rest().0) - Ball::from(earlier.rest().0);
    rest / Ball::from(later.fast_period().0) + Ball::from(later.whole() - earlier.whole())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Seconds;

    #[test]
    fn times_are_enclosed_relatively_and_samples_are_not_too_late() {
        let at = |t| GridTime::new(Seconds(t), Seconds(0.1));
        let apart: Ball<BigFloat> = between(at(-60_000.000_000_02), at(-60_000.000_000_005));
        let exact = (60_000.000_000_02_f64 - 60_000.000_000_005) / 0.1;
        assert!((apart.nearest() / exact - 1.0).abs() < 1e-15 && apart.radius() < 1e-30 * exact, "{apart:?}");
        assert_eq!(between::<BigFloat>(at(0.3), at(0.3)), Ball::ZERO);
        let (gain, converter_gain) = (Ball::from(1.0), 1.0);
        let sample = |t| SamplingInstant { filter: 0, gain, converter_gain, time: at(t) };
        let far = timeline(&[sample(0.0), sample(-1e100)], 2);
        assert!(matches!(far, Err(VerifyError::TooLate { periods }) if periods > 1e100));
    }
}
