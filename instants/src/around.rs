//! The samples of all recordings around some instants.

use super::estimator::TimedSample;
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use std::ops::Range;

/// Samples of all recordings, one recording after another.
pub(super) struct Around {
    /// With instants relative to the first of those that they lie around.
    pub(super) samples: Vec<TimedSample>,
    /// What they are.
    pub(super) values: Vec<f64>,
    /// Where those of each recording are among them.
    pub(super) places: Vec<Range<usize>>,
}

impl Around {
    /// Those between two instants, and `reach` more of each recording on either side, as far as they are
    /// there and not more than `within` away.
    pub(super) fn new(
        recordings: &[Recording],
        instants: Range<FastPeriods>,
        reach: usize,
        within: FastPeriods,
    ) -> Self {
        let (mut samples, mut values, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for recording in recordings {
            let begin = samples.len();
            for number in recording.around(instants.clone(), reach, within) {
                let sample = recording.sample(number as i64);
                samples.push(TimedSample { instant: sample.instant - instants.start, ..sample });
                values.push(recording.value(number));
            }
            places.push(begin..samples.len());
        }
        Self { samples, values, places }
    }

    /// Of each recording that has samples here, the one that is nearest to the first instant.
    pub(super) fn nearest(&self) -> Vec<usize> {
        let distance = |k: &usize| self.samples[*k].instant.0.abs();
        let nearest = |place: &Range<usize>| place.clone().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        self.places.iter().filter_map(nearest).collect()
    }
}
