//! The predicted error over a run: its mean, and its worst second.

use crate::instants::Fused;
use crate::units::{Decibels, Seconds};
use std::collections::VecDeque;

/// The predicted signal-to-noise ratio of a run, for a signal that is flat over the band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictedQuality {
    /// Away from the ends.
    pub snr: Decibels,
    /// Of the worst second.
    pub worst_second: Decibels,
    /// When it begins, after the first output.
    pub worst_at: Seconds,
}

/// The errors of blocks so far.
#[derive(Debug)]
pub(super) struct ErrorCourse {
    /// Blocks of a second.
    second: usize,
    /// The last ones, at most those of a second.
    recent: VecDeque<f64>,
    sum: f64,
    count: usize,
    worst: Option<WorstSecond>,
}

/// The second of a run that has the largest errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct WorstSecond {
    /// Its first block.
    pub(super) first: usize,
    /// The mean error of its blocks.
    pub(super) mean: f64,
}

impl ErrorCourse {
    /// For so many blocks a second.
    pub(super) fn new(per_second: f64) -> Self {
        let second = (per_second.round() as usize).max(1);
        Self { second, recent: VecDeque::new(), sum: 0.0, count: 0, worst: None }
    }

    /// The next block.
    pub(super) fn add(&mut self, error: f64) {
        if self.recent.len() == self.second {
            self.recent.pop_front();
        }
        self.recent.push_back(error);
        (self.sum, self.count) = (self.sum + error, self.count + 1);
        if self.recent.len() == self.second {
            let last = self.last_second();
            self.worst = self.worst.filter(|worst| worst.mean > last.mean).or(Some(last));
        }
    }

    fn last_second(&self) -> WorstSecond {
        let mean = self.recent.iter().sum::<f64>() / self.recent.len().max(1) as f64;
        WorstSecond { first: self.count - self.recent.len(), mean }
    }

    /// The worst second, or all blocks if they are fewer.
    pub(super) fn worst(&self) -> WorstSecond {
        self.worst.unwrap_or_else(|| self.last_second())
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The mean of all blocks.
    pub(super) fn mean(&self) -> f64 {
        self.sum / self.count.max(1) as f64
    }
}

/// The errors of a run without its first and its last block: those have the errors of the ends of a
/// recording, where samples on one side lack.
#[derive(Debug)]
pub(super) struct InnerCourse {
    block: Seconds,
    first: Option<f64>,
    last: Option<f64>,
    inner: ErrorCourse,
}

impl InnerCourse {
    /// For blocks of this length.
    pub(super) fn new(block: Seconds) -> Self {
        Self { block, first: None, last: None, inner: ErrorCourse::new(1.0 / block.0) }
    }

    /// The next samples; their errors count.
    pub(super) fn judged(&mut self, fused: Fused) -> Vec<f64> {
        fused.errors.iter().for_each(|error| self.add(error.total()));
        fused.samples
    }

    /// The next block.
    fn add(&mut self, error: f64) {
        if self.first.is_none() {
            self.first = Some(error);
        } else if let Some(before) = self.last.replace(error) {
            self.inner.add(before);
        }
    }

    /// Of all so far. A run of two blocks has nothing but ends.
    pub(super) fn quality(mut self) -> PredictedQuality {
        let skipped = if self.inner.is_empty() { 0.0 } else { 1.0 };
        if self.inner.is_empty() {
            self.first.into_iter().chain(self.last).for_each(|error| self.inner.add(error));
        }
        let ratio = |error: f64| Decibels::of_power(1.0 / error.max(f64::MIN_POSITIVE));
        let worst = self.inner.worst();
        PredictedQuality {
            snr: ratio(self.inner.mean()),
            worst_second: ratio(worst.mean),
            worst_at: self.block * (skipped + worst.first as f64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the definition, over all seconds.
    #[test]
    fn the_worst_second_is_found_on_the_way() {
        let errors = [9.0, 1.0, 2.0, 5.0, 4.0, 0.5, 3.0, 6.0];
        let of = |second: f64, errors: &[f64]| {
            let mut course = ErrorCourse::new(second);
            errors.iter().for_each(|error| course.add(*error));
            let worst = course.worst();
            (worst.first, worst.mean)
        };
        assert_eq!(of(3.0, &errors[1..]), (1, 11.0 / 3.0));
        assert_eq!(of(20.0, &errors[..2]), (0, 5.0));
        let mut course = InnerCourse::new(Seconds(0.25));
        errors.iter().for_each(|error| course.add(*error));
        let PredictedQuality { snr, worst_second, worst_at } = course.quality();
        assert!((snr.0 + 10.0 * (15.5_f64 / 6.0).log10()).abs() < 1e-12, "{snr}");
        assert!((worst_second.0 + 10.0 * (3.125_f64).log10()).abs() < 1e-12, "{worst_second}");
        assert_eq!(worst_at, Seconds(0.75));
    }
}
