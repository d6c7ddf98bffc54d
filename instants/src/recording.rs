//! The samples of one converter with their instants.

use super::clock::Clock;
use super::estimator::TimedSample;
use hybank_core::units::FastPeriods;
use std::ops::Range;
use std::sync::Arc;

/// What one converter delivered.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    samples: Vec<f64>,
    /// The number of the first of them; those before it were forgotten.
    first: usize,
    clock: Arc<Clock>,
    converter: usize,
    /// Lost samples before each sample, and before the end; from time to time they begin at 0 again.
    lost: Vec<u32>,
}

impl Recording {
    /// `samples` of a converter, without its offset; those that are not finite were lost.
    pub fn new(samples: Vec<f64>, clock: Clock, converter: usize) -> Self {
        let mut recording =
            Self { samples: Vec::new(), first: 0, clock: Arc::new(clock), converter, lost: vec![0] };
        recording.extend(samples);
        recording
    }

    /// Takes the next samples.
    pub(super) fn extend(&mut self, samples: impl IntoIterator<Item = f64>) {
        let begin = self.samples.len();
        self.samples.extend(samples);
        let mut lost = self.lost[begin];
        self.lost.extend(self.samples[begin..].iter().map(|sample| {
            lost = lost.wrapping_add(u32::from(!sample.is_finite()));
            lost
        }));
    }

    /// From now on it has another clock.
    pub(super) fn follow(&mut self, clock: Arc<Clock>) {
        self.clock = clock;
    }

    /// Lets go of the samples before an instant.
    pub(super) fn forget(&mut self, before: FastPeriods) {
        let end = self.clock.sample_at(before).max(0.0) as usize;
        let count = end.saturating_sub(self.first).min(self.samples.len());
        self.samples.drain(..count);
        self.lost.drain(..count);
        self.first += count;
    }

    /// The number of the next sample.
    fn end(&self) -> usize {
        self.first + self.samples.len()
    }

    /// The instant of the next sample.
    pub(super) fn next(&self) -> FastPeriods {
        self.clock.at(self.end() as f64)
    }

    /// The samples that are there, from the first one on if none was forgotten; lost ones are NaN or
    /// infinite.
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
        self.clock.at(self.first as f64)..self.clock.at(self.end().saturating_sub(1) as f64)
    }

    /// The sample that is nearest to an instant; of two, the later one. It may lie beyond either end.
    pub(super) fn nearest(&self, instant: FastPeriods) -> i64 {
        (self.clock.sample_at(instant) + 0.5).floor() as i64
    }

    /// These samples, if all are there.
    pub(super) fn whole(&self, samples: Range<i64>) -> Option<&[f64]> {
        let place = |number: i64| usize::try_from(number - self.first as i64).ok();
        let (start, end) = (place(samples.start)?, place(samples.end)?);
        let slice = self.samples.get(start..end)?;
        (self.lost[start] == self.lost[end]).then_some(slice)
    }

    /// The value of a sample that is there.
    pub(super) fn value(&self, number: usize) -> f64 {
        self.samples[number - self.first]
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
        let last = self.end() as i64;
        let first = self.nearest(instants.start).clamp(self.first as i64, last) as usize;
        let end = (self.nearest(instants.end) + 1).clamp(first as i64, last) as usize;
        let (earliest, latest) = (instants.start - within, instants.end + within);
        let is_near = |k: &usize| (earliest..=latest).contains(&self.clock.at(*k as f64));
        let is_there = |k: &usize| self.value(*k).is_finite();
        let before = (self.first..first).rev().take_while(is_near).filter(is_there).take(count);
        let mut numbers: Vec<usize> = before.collect();
        numbers.reverse();
        numbers.extend((first..end).filter(is_near).filter(is_there));
        numbers.extend((end..self.end()).take_while(is_near).filter(is_there).take(count));
        numbers
    }

    /// The periods of its clock between knots.
    pub(super) fn periods(&self) -> Vec<f64> {
        self.clock.periods(f64::NEG_INFINITY..f64::INFINITY).collect()
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
        assert!([0..8, 11..20].map(|range| recording.whole(range).is_some()) == [true; 2]);
        assert!([7..9, -1..3, 15..21].map(|range| recording.whole(range).is_some()) == [false; 3]);
    }

    #[test]
    fn what_is_left_after_forgetting_keeps_its_numbers() {
        let clock = Clock::even(FastPeriods(0.5), FastPeriods(2.0));
        let mut recording = Recording::new((0..20).map(f64::from).collect(), clock, 0);
        recording.forget(FastPeriods(15.0));
        recording.extend([f64::NAN, 21.0]);
        assert_eq!((recording.whole(7..9), recording.whole(6..9)), (Some(&[7.0, 8.0][..]), None));
        assert_eq!((recording.whole(18..21), recording.next()), (None, FastPeriods(44.5)));
        let between = FastPeriods(16.0)..FastPeriods(42.9);
        let numbers = recording.around(between, 1, FastPeriods(99.0));
        assert_eq!(numbers, (7..20).chain([21]).collect::<Vec<_>>());
        assert_eq!(recording.value(21), 21.0);
    }
}
