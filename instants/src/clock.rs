//! When the samples of a recording were taken.

use hybank_core::units::FastPeriods;
use std::ops::Range;

/// The instants of the samples of one recording: a line through knots, which may be as few as two, for an
/// even clock, or as many as the samples, for time stamps.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// Numbers of samples, ascending.
    samples: Vec<f64>,
    /// Their instants in fast periods, ascending.
    instants: Vec<f64>,
}

/// Why knots are no clock.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClockError {
    /// Fewer than two.
    #[error("the instants of {count} samples make no clock; at least 2 are needed")]
    TooFew {
        /// How many there are.
        count: usize,
    },
    /// Time stands still or runs back, or is no number.
    #[error(
        "the instant of sample {sample} is not after the one before it; sort the samples by their instants"
    )]
    NotAscending {
        /// The sample.
        sample: f64,
    },
}

impl Clock {
    /// Sample 0 at `first`, and one more every `period`, which is above 0.
    pub fn even(first: FastPeriods, period: FastPeriods) -> Self {
        Self { samples: vec![0.0, 1.0], instants: vec![first.0, first.0 + period.0] }
    }

    /// One instant for each sample, from sample 0 on.
    ///
    /// # Errors
    /// [`ClockError`].
    pub fn stamps(instants: &[FastPeriods]) -> Result<Self, ClockError> {
        Self::through((0..instants.len()).map(|k| k as f64).zip(instants.iter().copied()))
    }

    /// A line through knots, each the number of a sample and its instant. It goes on straight at both ends.
    ///
    /// # Errors
    /// [`ClockError`].
    pub fn through(knots: impl IntoIterator<Item = (f64, FastPeriods)>) -> Result<Self, ClockError> {
        let (samples, instants): (Vec<f64>, Vec<f64>) = knots.into_iter().map(|(k, t)| (k, t.0)).unzip();
        if samples.len() < 2 {
            return Err(ClockError::TooFew { count: samples.len() });
        }
        let rises =
            |values: &[f64], k: usize| values[k] > values[k - 1] && (values[k] - values[k - 1]).is_finite();
        match (1..samples.len()).find(|&k| !rises(&samples, k) || !rises(&instants, k)) {
            Some(k) => Err(ClockError::NotAscending { sample: samples[k] }),
            None => Ok(Self { samples, instants }),
        }
    }

    /// The instant of a sample.
    pub fn at(&self, sample: f64) -> FastPeriods {
        FastPeriods(on_line(&self.samples, &self.instants, sample))
    }

    /// The sample, with its fraction, that would be taken at an instant.
    pub fn sample_at(&self, instant: FastPeriods) -> f64 {
        on_line(&self.instants, &self.samples, instant.0)
    }

    /// The periods between knots, as far as `samples` reach.
    pub(super) fn periods(&self, samples: Range<f64>) -> impl Iterator<Item = f64> {
        let [first, last] = [samples.start, samples.end].map(|sample| segment(&self.samples, sample));
        let rise = |values: &[f64], k: usize| values[k + 1] - values[k];
        (first..=last).map(move |k| rise(&self.instants, k) / rise(&self.samples, k))
    }
}

/// The first of the two knots between which `x` lies, or that are closest to it.
fn segment(knots: &[f64], x: f64) -> usize {
    knots.partition_point(|knot| *knot <= x).clamp(1, knots.len() - 1) - 1
}

fn on_line(x: &[f64], y: &[f64], at: f64) -> f64 {
    let k = segment(x, at);
    y[k] + (at - x[k]) * ((y[k + 1] - y[k]) / (x[k + 1] - x[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_and_its_inverse_agree() {
        let clock =
            Clock::through([(0.0, FastPeriods(3.0)), (10.0, FastPeriods(23.5)), (11.0, FastPeriods(40.0))]);
        let clock = clock.unwrap();
        for sample in [-4.0, 0.0, 2.5, 10.0, 10.75, 11.0, 20.0] {
            assert!((clock.sample_at(clock.at(sample)) - sample).abs() < 1e-12);
        }
        assert_eq!((clock.at(10.0), clock.at(12.0)), (FastPeriods(23.5), FastPeriods(56.5)));
        let periods = |samples| clock.periods(samples).collect::<Vec<_>>();
        assert_eq!((periods(2.0..9.0), periods(2.0..11.0)), (vec![2.05], vec![2.05, 16.5]));
    }

    #[test]
    fn time_that_stands_still_is_refused() {
        let stamps =
            |instants: &[f64]| Clock::stamps(&instants.iter().copied().map(FastPeriods).collect::<Vec<_>>());
        assert_eq!(stamps(&[1.0]), Err(ClockError::TooFew { count: 1 }));
        assert_eq!(stamps(&[1.0, 2.0, 2.0]), Err(ClockError::NotAscending { sample: 2.0 }));
        assert_eq!(stamps(&[1.0, 2.0, f64::NAN]), Err(ClockError::NotAscending { sample: 2.0 }));
        assert!(stamps(&[1.0, 2.0, 2.5]).is_ok());
    }
}
