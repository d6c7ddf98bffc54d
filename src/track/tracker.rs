//! The filters of all channels, with a gate and a lock state.

use super::coincidence::Coincidence;
use super::filter::{DelayFilter, DelayMeasurement, DelayState, DriftModel, Innovation};
use crate::units::Seconds;

/// Innovations beyond this many standard deviations are refused: one in 1.7 million by chance.
const GATE: f64 = 5.0;
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
    /// Measurements contradict the filter again and again.
    Lost,
}

/// Follows the delays of N channels relative to the reference.
#[derive(Debug, Clone)]
pub struct DelayTracker {
    channels: Vec<Channel>,
    /// Standard deviation at which a delay counts as known.
    wanted: Seconds,
}

#[derive(Debug, Clone, Copy)]
struct Channel {
    filter: DelayFilter,
    /// Measurements refused since the last one that was taken.
    refused: u32,
}

impl DelayTracker {
    /// Filters that know `states`, one for each channel; `wanted` is the standard deviation at which a delay
    /// counts as known.
    pub fn new(states: &[DelayState], model: DriftModel, wanted: Seconds) -> Self {
        let channel = |&state: &DelayState| Channel { filter: DelayFilter::new(state, model), refused: 0 };
        Self { channels: states.iter().map(channel).collect(), wanted }
    }

    /// N.
    pub fn len(&self) -> usize {
        self.channels.len()
    }

    /// True without channels.
    pub fn is_empty(&self) -> bool {
        self.channels.is_empty()
    }

    /// Lets the time `elapsed` pass for all channels. Without measurements the delays go on at their rates,
    /// and their variances grow.
    pub fn advance(&mut self, elapsed: Seconds) {
        self.channels.iter_mut().for_each(|channel| channel.filter.advance(elapsed));
    }

    /// Takes a measurement of channel `i` and returns true, or refuses one that lies too far from what is
    /// expected: then the delay is as before. A channel that is [`Lock::Lost`] needs a
    /// [restart](Self::restart).
    ///
    /// # Panics
    /// If there is no channel `i`.
    pub fn update(&mut self, i: usize, measurement: DelayMeasurement) -> (Innovation, bool) {
        let channel = &mut self.channels[i];
        let innovation = channel.filter.innovation(measurement);
        if innovation.sigmas() <= GATE {
            channel.refused = 0;
            channel.filter.update(measurement);
            return (innovation, true);
        }
        channel.refused += 1;
        (innovation, false)
    }

    /// Begins again with what is known of channel `i` from elsewhere, for example after [`Lock::Lost`].
    ///
    /// # Panics
    /// If there is no channel `i`.
    pub fn restart(&mut self, i: usize, state: DelayState) {
        let channel = &mut self.channels[i];
        *channel = Channel { filter: channel.filter.restarted(state), refused: 0 };
    }

    /// What is known of each channel.
    pub fn states(&self) -> impl Iterator<Item = DelayState> {
        self.channels.iter().map(|channel| channel.filter.state())
    }

    /// Whether each channel is locked.
    pub fn locks(&self) -> impl Iterator<Item = Lock> {
        self.channels.iter().map(|channel| {
            if channel.refused >= MOST_REFUSED {
                Lock::Lost
            } else if channel.filter.state().deviation() <= self.wanted {
                Lock::Locked
            } else {
                Lock::Held
            }
        })
    }

    /// As [`Coincidence::ahead`].
    pub fn coincidence(
        &self,
        slow_period: Seconds,
        distance: Seconds,
        horizon: Seconds,
    ) -> Option<Coincidence> {
        let states: Vec<DelayState> = self.states().collect();
        Coincidence::ahead(&states, slow_period, distance, horizon)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tracker() -> DelayTracker {
        let states = [DelayState::known(Seconds(1.0), 0.1, 0.01), DelayState::known(Seconds(2.0), 0.1, 0.01)];
        DelayTracker::new(&states, DriftModel { delay_walk: 1e-4, rate_walk: 0.0 }, Seconds(0.05))
    }

    fn measured(delay: f64) -> DelayMeasurement {
        DelayMeasurement { delay: Seconds(delay), variance: 1e-4 }
    }

    fn locks(tracker: &DelayTracker) -> Vec<Lock> {
        tracker.locks().collect()
    }

    #[test]
    fn a_channel_locks_by_measurements_and_is_held_in_silence() {
        let mut tracker = tracker();
        assert_eq!(locks(&tracker), [Lock::Held; 2]);
        assert!(tracker.update(1, measured(2.05)).1);
        assert_eq!(locks(&tracker), [Lock::Held, Lock::Locked]);
        let known = tracker.channels[1].filter.state().delay;
        // sqrt(1e-4 + 1e-4 t + (0.01 t)^2) reaches 0.05 before 5 s.
        tracker.advance(Seconds(5.0));
        assert_eq!(locks(&tracker), [Lock::Held; 2]);
        assert_eq!(tracker.channels[1].filter.state().delay, known);
    }

    #[test]
    fn a_contradiction_is_refused_and_many_of_them_are_a_loss() {
        let mut tracker = tracker();
        tracker.update(0, measured(1.0));
        let before = tracker.channels[0].filter.state();
        for refused in 1..=MOST_REFUSED {
            let (innovation, taken) = tracker.update(0, measured(1.5));
            assert!(!taken && innovation.sigmas() > GATE);
            assert_eq!(tracker.channels[0].filter.state(), before);
            assert_eq!(locks(&tracker)[0], if refused < MOST_REFUSED { Lock::Locked } else { Lock::Lost });
        }
        tracker.restart(0, DelayState::known(Seconds(1.5), 0.01, 0.0));
        assert!(tracker.update(0, measured(1.5)).1);
        assert_eq!(locks(&tracker)[0], Lock::Locked);
    }
}
