//! The samples of a slow period, and enclosures of the times between them.

use super::VerifyError;
use super::ball::Ball;
use crate::arithmetic::{Float, LongBall};
use hybank_core::units::{Fraction, GridTime, Timeline};

/// Maximum number of periods by which a sample may be late; the limit keeps the count exact in doubles.
const MAX_PERIODS_LATE: f64 = (1u64 << 40) as f64;

/// What is sampled, and when.
#[derive(Debug, Clone, Copy)]
pub(super) struct SamplingInstant {
    /// Index of the filter.
    pub(super) filter: usize,
    /// The sample over the output of the filter, not zero.
    pub(super) gain: LongBall,
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
pub(super) fn between<F: Float>(earlier: GridTime, later: GridTime) -> Ball<F> {
    if earlier == later {
        return Ball::ZERO;
    }
    let part = |time: GridTime| {
        let Fraction { numerator, denominator } = time.part();
        Ball::from(f64::from(numerator)) / Ball::from(f64::from(denominator))
    };
    let rest = Ball::from(later.rest().0) - Ball::from(earlier.rest().0);
    let whole = Ball::from(later.whole() - earlier.whole());
    // A fraction of zero would only widen the enclosure.
    let parts = if later.part() == earlier.part() { Ball::ZERO } else { part(later) - part(earlier) };
    rest / Ball::from(later.fast_period().0) + whole + parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arithmetic::Float512;
    use hybank_core::units::Seconds;

    #[test]
    fn times_are_enclosed_relatively_and_samples_are_not_too_late() {
        let at = |t| GridTime::new(Seconds(t), Seconds(0.1));
        let apart: LongBall = between(at(-60_000.000_000_02), at(-60_000.000_000_005));
        let exact = (60_000.000_000_02_f64 - 60_000.000_000_005) / 0.1;
        assert!((apart.nearest() / exact - 1.0).abs() < 1e-15 && apart.radius() < 1e-30 * exact, "{apart:?}");
        assert_eq!(between::<Float512>(at(0.3), at(0.3)), Ball::ZERO);
        let sample = |t| SamplingInstant { filter: 0, gain: Ball::from(1.0), time: at(t) };
        let far = timeline(&[sample(0.0), sample(-1e100)], 2);
        assert!(matches!(far, Err(VerifyError::TooLate { periods }) if periods > 1e100));
    }
}
