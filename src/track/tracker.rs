//! What is known of the delay of one channel: by the filter with a gate, or by readings that are known
//! beforehand.

use super::filter::{DelayFilter, DelayMeasurement, DelayState};
use super::timeline::Timeline;
use crate::units::Seconds;

/// Innovations beyond this many standard deviations are refused: one in 1.7 million by chance.
const GATE_SIGMAS: f64 = 5.0;
/// Refused measurements in a row after which a channel is lost: then the model is wrong, not the
/// measurement.
const MOST_REFUSED: u32 = 5;

/// Whether a channel's delay is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Lock {
    /// The standard deviation is at most the wanted one.
    Locked,
    /// It is not: nothing has come for a while, or not yet enough.
    Held,
}

/// What became of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Taken {
    Used,
    /// It lies too far from what is expected; the delay is as before.
    Refused,
    /// Measurements contradicted the filter again and again, so it begins again with this one.
    Restarted,
}

/// The delay of one channel relative to the reference.
#[derive(Debug, Clone)]
pub(super) struct DelayTracker {
    /// The channel, from 0.
    pub(super) channel: usize,
    filter: DelayFilter,
    /// With readings enough, what they say takes the place of the filter.
    timeline: Option<Timeline>,
    /// Measurements refused since the last one that was taken.
    refused: u32,
}

impl DelayTracker {
    pub(super) fn new(channel: usize, filter: DelayFilter, timeline: Option<Timeline>) -> Self {
        Self { channel, filter, timeline, refused: 0 }
    }

    /// What is known now.
    pub(super) fn state(&self) -> DelayState {
        self.filter.state()
    }

    /// Whether the standard deviation is at most `wanted`.
    pub(super) fn lock(&self, wanted: Seconds) -> Lock {
        if self.state().deviation() <= wanted { Lock::Locked } else { Lock::Held }
    }

    /// The readings that are known beforehand.
    pub(super) fn timeline(&self) -> Option<&Timeline> {
        self.timeline.as_ref()
    }

    /// Lets time pass: without measurements the delay goes on at its rate, and its variance grows.
    pub(super) fn advance(&mut self, elapsed: Seconds) {
        self.filter.advance(elapsed);
    }

    /// Takes what the timeline says of a time, if there is one.
    pub(super) fn look_up(&mut self, time: Seconds) {
        if let Some(timeline) = &self.timeline {
            self.filter = self.filter.restarted(timeline.at(time));
        }
    }

    /// Takes the measurement of a frame. A filter that begins again knows its rate by `rate_deviation`.
    pub(super) fn take(&mut self, frame: u64, measurement: DelayMeasurement, rate_deviation: f64) -> Taken {
        if let Some(timeline) = &self.timeline {
            return if timeline.refuses(frame) { Taken::Refused } else { Taken::Used };
        }
        if self.filter.innovation(measurement).sigmas() <= GATE_SIGMAS {
            self.refused = 0;
            self.filter.update(measurement);
            return Taken::Used;
        }
        self.refused += 1;
        if self.refused < MOST_REFUSED {
            return Taken::Refused;
        }
        let state = DelayState::known(measurement.delay, measurement.variance.sqrt(), rate_deviation);
        (self.filter, self.refused) = (self.filter.restarted(state), 0);
        Taken::Restarted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: Seconds = Seconds(0.05);

    fn tracker() -> DelayTracker {
        let filter = DelayFilter::new(DelayState::known(Seconds(1.0), 0.1, 0.01), 0.0);
        DelayTracker::new(0, filter, None)
    }

    fn measured(delay: f64) -> DelayMeasurement {
        DelayMeasurement { delay: Seconds(delay), variance: 1e-4 }
    }

    #[test]
    fn a_channel_locks_by_measurements_and_is_held_in_silence() {
        let mut tracker = tracker();
        assert_eq!(tracker.lock(WANTED), Lock::Held);
        assert_eq!(tracker.take(0, measured(1.05), 0.01), Taken::Used);
        assert_eq!(tracker.lock(WANTED), Lock::Locked);
        let known = tracker.state().delay;
        // sqrt(1e-4 + (0.01 t)^2) reaches 0.05 before 5 s.
        tracker.advance(Seconds(5.0));
        assert_eq!((tracker.lock(WANTED), tracker.state().delay), (Lock::Held, known));
    }

    #[test]
    fn a_contradiction_is_refused_and_many_of_them_are_a_loss() {
        let mut tracker = tracker();
        tracker.take(0, measured(1.0), 0.01);
        let before = tracker.state();
        for _ in 1..MOST_REFUSED {
            assert_eq!(tracker.take(0, measured(1.5), 0.01), Taken::Refused);
            assert_eq!((tracker.state(), tracker.lock(WANTED)), (before, Lock::Locked));
        }
        assert_eq!(tracker.take(0, measured(1.5), 0.01), Taken::Restarted);
        assert_eq!((tracker.state().delay, tracker.lock(WANTED)), (Seconds(1.5), Lock::Locked));
        assert_eq!(tracker.take(0, measured(1.5), 0.01), Taken::Used);
    }
}
