//! The samples of one converter with their instants.

use super::clock::Clock;
use super::estimator::TimedSample;
use hybank_core::units::FastPeriods;
use std::ops::Range;

/// What one converter delivered.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    samples: Vec<f64>,
    clock: Clock,
    converter: usize,
    /// Lost samples before each sample, and before the end.
    lost: Vec<u32>,
}

impl Recording {
    /// `samples` of a converter, without its offset; those that are not finite were lost.
    pub fn new(samples: Vec<f64>, clock: Clock, converter: usize) -> Self {
        let mut lost = Vec::with_capacity(samples.len() + 1);
        lost.push(0);
        let count = |before: &mut u32, sample: &f64| {
            *before += u32::from(!sample.is_finite());
            Some(*before)
        };
        lost.extend(samples.iter().scan(0, count));
        Self { samples, clock, converter, lost }
    }

    /// The samples; lost ones are NaN or infinite.
    pub fn samples(&self) -> &[f64] {
        &self.samples
    }

    /// When they were taken.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// The number of the converter in [`Signals`](super::Signals).
    pub fn converter(&self) -> usize {
        self.converter
    }

    /// The instants of the first sample and of the last.
    pub fn span(&self) -> Range<FastPeriods> {
        self.clock.at(0.0)..self.clock.at(self.samples.len().saturating_sub(1) as f64)
    }

    /// The sample that is nearest to an instant; of two, the later one. It may lie beyond either end.
    pub(super) fn nearest(&self, instant: FastPeriods) -> i64 {
        (self.clock.sample_at(instant) + 0.5).floor() as i64
    }

    /// Whether all these samples are there.
    pub(super) fn is_whole(&self, samples: &Range<i64>) -> bool {
        let inside = samples.start >= 0 && samples.end <= self.samples.len() as i64;
        inside && self.lost[samples.start as usize] == self.lost[samples.end as usize]
    }

    /// One of the samples with its instant.
    pub(super) fn sample(&self, number: i64) -> TimedSample {
        TimedSample { converter: self.converter, instant: self.clock.at(number as f64) }
    }

    /// The numbers of the samples that are there: those between two instants, and `count` more at either
    /// side, as far as there are so many and not more than `within` away.
    pub(super) fn around(
        &self,
        instants: Range<FastPeriods>,
        count: usize,
        within: FastPeriods,
    ) -> Vec<usize> {
        let last = self.samples.len() as i64;
        let first = self.nearest(instants.start).clamp(0, last) as usize;
        let end = (self.nearest(instants.end) + 1).clamp(first as i64, last) as usize;
        let (earliest, latest) = (instants.start - within, instants.end + within);
        let is_near = |k: &usize| (earliest..=latest).contains(&self.clock.at(*k as f64));
        let is_there = |k: &usize| self.samples[*k].is_finite();
        let before = (0..first).rev().take_while(is_near).filter(is_there).take(count);
        let mut numbers: Vec<usize> = before.collect();
        numbers.reverse();
        numbers.extend((first..end).filter(is_near).filter(is_there));
        numbers.extend((end..self.samples.len()).take_while(is_near).filter(is_there).take(count));
        numbers
    }

    /// The periods of its clock between knots.
    pub(super) fn periods(&self) -> Vec<f64> {
        self.clock.periods(0.0..self.samples.len().saturating_sub(1) as f64).collect()
    }

    /// The usual period.
    pub(super) fn period(&self) -> f64 {
        let mut periods = self.periods();
        let middle = periods.len() / 2;
        *periods.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_samples_are_left_out_of_sets() {
        let mut samples = vec![1.0; 20];
        samples[8..11].fill(f64::NAN);
        let recording = Recording::new(samples, Clock::even(FastPeriods(0.5), FastPeriods(2.0)), 0);
        let between = FastPeriods(14.5)..FastPeriods(18.5);
        assert_eq!(recording.around(between, 2, FastPeriods(99.0)), [5, 6, 7, 11, 12]);
        let at = |first, last, within| {
            recording.around(FastPeriods(first)..FastPeriods(last), 2, FastPeriods(within))
        };
        assert_eq!(at(-9.0, 1.0, 99.0), [0, 1, 2]);
        assert_eq!(at(99.0, 99.0, 99.0), [18, 19]);
        assert_eq!((at(99.0, 99.0, 59.0), at(99.0, 99.0, 61.0)), (vec![], vec![19]));
        assert!(recording.is_whole(&(0..8)) && recording.is_whole(&(11..20)));
        assert!(
            !recording.is_whole(&(7..9)) && !recording.is_whole(&(-1..3)) && !recording.is_whole(&(15..21))
        );
    }
}
