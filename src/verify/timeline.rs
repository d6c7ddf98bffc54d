//! The sampling instants of a slow period, compared exactly.
//!
//! A delay D in seconds and a fast period h are doubles, and D / h is a rational number that a double may
//! not represent. Instants are kept as whole - D / h and compared without rounding, so that a delay near a
//! whole number is not treated as whole.

use super::VerifyError;
use super::ball::Ball;
use crate::arithmetic::{BigFloat, Number};
use crate::units::{FastPeriods, Seconds};
use std::cmp::Ordering;

/// Maximum number of periods by which a sample may be late; the limit keeps the count exact in doubles.
const MAX_PERIODS_LATE: f64 = (1u64 << 40) as f64;

/// The instant `whole - delay / h` in fast periods, `whole` a whole number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Instant {
    pub(super) whole: f64,
    pub(super) delay: Seconds,
}

/// What is sampled, and when.
#[derive(Debug, Clone, Copy)]
pub(super) struct SamplingInstant {
    /// Index of the filter.
    pub(super) filter: usize,
    /// The output of the sample's own filter over that filter's, not zero.
    pub(super) gain: Ball<BigFloat>,
    /// The sample over the output of its own filter, not zero.
    pub(super) converter_gain: f64,
    pub(super) time: Instant,
}

/// The instants of one slow period, which ends with the latest sample.
#[derive(Debug, Clone)]
pub(super) struct Timeline {
    /// h.
    fast_period: Seconds,
    start: Instant,
    /// Ascending, each once, the end of the period last.
    instants: Vec<Instant>,
    /// Index of each sample's instant.
    of: Vec<usize>,
    /// Whole slow periods from a sample's instant to that in which it is counted.
    delay_periods: Vec<usize>,
}

/// Sign of a sum of three numbers of at most 106 bits: exact, because the two largest are added first,
/// without rounding where they cancel.
fn sign(mut terms: [BigFloat; 3]) -> Ordering {
    terms.sort_by(|a, b| b.compare_moduli(a));
    (terms[0] + terms[1] + terms[2]).sign()
}

impl Instant {
    fn later_by_periods(self, periods: f64, ratio: usize) -> Self {
        Self { whole: self.whole + periods * ratio as f64, ..self }
    }

    /// Compares two instants exactly.
    fn compare(self, other: Self, fast_period: Seconds) -> Ordering {
        let difference = BigFloat::from(self.whole - other.whole) * BigFloat::from(fast_period.0);
        sign([difference, BigFloat::from(other.delay.0), -BigFloat::from(self.delay.0)])
    }

    /// The most slow periods of `ratio` fast periods from this instant on that do not pass `latest`.
    fn periods_before(self, latest: Self, fast_period: Seconds, ratio: usize) -> Result<f64, VerifyError> {
        let age = latest.since::<BigFloat>(self, fast_period).nearest();
        let mut periods = (age / ratio as f64).floor();
        let is_supported = periods < MAX_PERIODS_LATE;
        if !is_supported {
            return Err(VerifyError::TooLate { periods });
        }
        let passes =
            |periods: f64| self.later_by_periods(periods, ratio).compare(latest, fast_period).is_gt();
        // The quotient may have been rounded across a whole number.
        while passes(periods) {
            periods -= 1.0;
        }
        while !passes(periods + 1.0) {
            periods += 1.0;
        }
        Ok(periods)
    }

    /// Encloses the time from `earlier` to this instant in fast periods; exactly zero if they are one.
    fn since<F: Number>(self, earlier: Self, fast_period: Seconds) -> Ball<F> {
        if self.compare(earlier, fast_period) == Ordering::Equal {
            return Ball::ZERO;
        }
        let delays = Ball::from(earlier.delay.0) - Ball::from(self.delay.0);
        delays / Ball::from(fast_period.0) + Ball::from(self.whole - earlier.whole)
    }
}

impl Timeline {
    /// Reduces the instants modulo the slow period of `ratio` fast periods, which ends with the latest
    /// sample.
    ///
    /// # Errors
    /// [`VerifyError::TooLate`] if a sample is later than the maximum number of periods.
    pub(super) fn new(
        samples: &[SamplingInstant],
        fast_period: Seconds,
        ratio: usize,
    ) -> Result<Self, VerifyError> {
        let compare = |a: Instant, b: Instant| a.compare(b, fast_period);
        let times = samples.iter().map(|sample| sample.time);
        let latest = times
            .clone()
            .max_by(|&a, &b| compare(a, b))
            .unwrap_or(Instant { whole: 0.0, delay: Seconds(0.0) });
        let periods = |time: Instant| time.periods_before(latest, fast_period, ratio);
        let late = times.clone().map(periods).collect::<Result<Vec<f64>, _>>()?;
        let folded: Vec<Instant> =
            times.zip(&late).map(|(time, &periods)| time.later_by_periods(periods, ratio)).collect();
        let mut instants = folded.clone();
        instants.sort_by(|&a, &b| compare(a, b));
        instants.dedup_by(|a, b| compare(*a, *b).is_eq());
        let of = |time: &Instant| instants.partition_point(|&other| compare(other, *time).is_lt());
        Ok(Self {
            fast_period,
            start: latest.later_by_periods(-1.0, ratio),
            of: folded.iter().map(of).collect(),
            instants,
            delay_periods: late.iter().map(|&periods| periods as usize).collect(),
        })
    }

    /// Time from `earlier` to `later` in fast periods, rounded to a double once.
    pub(super) fn between(&self, earlier: Instant, later: Instant) -> f64 {
        later.since::<BigFloat>(earlier, self.fast_period).nearest()
    }

    /// What the rounding of the delays of two instants to doubles may change in the time between them.
    pub(super) fn resolution(&self, a: Instant, b: Instant) -> FastPeriods {
        let delay = |instant: Instant| instant.delay.in_fast_periods(self.fast_period);
        delay(a).rounding_of_difference(delay(b))
    }

    /// Number of different instants.
    pub(super) fn len(&self) -> usize {
        self.instants.len()
    }

    /// Index of a sample's instant.
    pub(super) fn of(&self, sample: usize) -> usize {
        self.of[sample]
    }

    /// For each sample.
    pub(super) fn delay_periods(&self) -> &[usize] {
        &self.delay_periods
    }

    /// Time from the start of the period to the instant `k`, in fast periods.
    pub(super) fn since_start<F: Number>(&self, k: usize) -> Ball<F> {
        self.instants[k].since(self.start, self.fast_period)
    }

    /// Time from the instant `k - 1` to the instant `k`, in fast periods.
    pub(super) fn since_previous<F: Number>(&self, k: usize) -> Ball<F> {
        self.instants[k].since(self.instants[k - 1], self.fast_period)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample(whole: f64, delay: f64) -> SamplingInstant {
        SamplingInstant {
            filter: 0,
            gain: Ball::from(1.0),
            converter_gain: 1.0,
            time: Instant { whole, delay: Seconds(delay) },
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

        /// Against integers: delays that are m 2^-60 with h = a 2^-60, where D / h compares as m with n a.
        #[test]
        fn whole_numbers_are_told_from_their_neighbours(a in 1i64 << 40..1 << 43, n in 1i64..1000, off in -2i64..3) {
            let unit = 2f64.powi(-60);
            let m = (i128::from(n) * i128::from(a) + i128::from(off)) as f64;
            prop_assume!(m as i128 == i128::from(n) * i128::from(a) + i128::from(off));
            let delayed = Instant { whole: 0.0, delay: Seconds(m * unit) };
            let whole = Instant { whole: -n as f64, delay: Seconds(0.0) };
            prop_assert_eq!(delayed.compare(whole, Seconds(a as f64 * unit)), 0.cmp(&off));
            let timeline = Timeline::new(&[sample(-n as f64, 0.0), sample(0.0, m * unit)], Seconds(a as f64 * unit), 7).unwrap();
            prop_assert_eq!(timeline.len(), if off == 0 { 1 } else { 2 });
        }
    }

    #[test]
    fn samples_older_than_a_period_are_late() {
        let line = Timeline::new(
            &[sample(0.0, 0.0), sample(1.0, 0.0), sample(0.0, 2.5), sample(0.0, 4.0)],
            Seconds(1.0),
            2,
        )
        .unwrap();
        assert_eq!(line.delay_periods(), [0, 0, 1, 2]);
        assert_eq!((line.of(0), line.of(1), line.of(2), line.of(3)), (1, 2, 0, 1));
        let times: Vec<f64> = (0..3).map(|k| line.since_start::<BigFloat>(k).nearest()).collect();
        assert_eq!(times, [0.5, 1.0, 2.0]);
        let far = Timeline::new(&[sample(0.0, 0.0), sample(0.0, 1e300)], Seconds(1.0), 2);
        assert_eq!(far.unwrap_err(), VerifyError::TooLate { periods: 5e299 });
    }
}
