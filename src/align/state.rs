//! What is known of a delay at an instant, and delays that come together.

use crate::spec::Spec;
use crate::units::Seconds;

/// A delay, its rate of change, and what is known of them: the entries of the symmetric covariance matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayState {
    /// The expected delay.
    pub delay: Seconds,
    /// Its expected change, seconds per second (1e-6 is one part per million).
    pub rate: f64,
    /// Variance of the delay, s^2.
    pub delay_variance: f64,
    /// Covariance of delay and rate, s.
    pub covariance: f64,
    /// Variance of the rate.
    pub rate_variance: f64,
}

impl DelayState {
    /// A delay with the standard deviation `deviation` in seconds, whose rate is zero with the standard
    /// deviation `rate_deviation`.
    pub fn known(delay: Seconds, deviation: f64, rate_deviation: f64) -> Self {
        Self {
            delay,
            rate: 0.0,
            delay_variance: deviation * deviation,
            covariance: 0.0,
            rate_variance: rate_deviation * rate_deviation,
        }
    }

    /// Standard deviation of the delay.
    pub fn deviation(&self) -> Seconds {
        Seconds(self.delay_variance.sqrt())
    }
}

/// Delays closer than this share of a fast period are together.
const TOGETHER_DELAY: f64 = 0.05;

/// Two channels that will sample at one instant of the slow period. There they carry one measurement, and no
/// bank recovers what the other one carried: the noncausal bound rises as they come closer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coincidence {
    /// The channels, from 0.
    pub(super) channels: [usize; 2],
    /// Time until their delays are equal modulo the slow period.
    pub(super) after: Seconds,
}

impl Coincidence {
    /// The first pair whose delays come together modulo the slow period of a spec, at their present rates;
    /// `None` if there is none within `horizon`.
    pub(super) fn ahead(states: &[DelayState], spec: &Spec, horizon: Seconds) -> Option<Self> {
        let slow_period = spec.fast_period * spec.ratio as f64;
        Self::within(states, slow_period, spec.fast_period * TOGETHER_DELAY, horizon)
    }

    /// As [`Coincidence::ahead`], where delays within `distance` of each other are together.
    fn within(
        states: &[DelayState],
        slow_period: Seconds,
        distance: Seconds,
        horizon: Seconds,
    ) -> Option<Self> {
        let pairs = (0..states.len()).flat_map(|i| (0..i).map(move |j| [j, i]));
        let meeting = |channels: [usize; 2]| {
            let [a, b] = channels.map(|i| states[i]);
            let apart = (b.delay - a.delay).0.rem_euclid(slow_period.0);
            let after = time_to_meet(apart, b.rate - a.rate, slow_period.0, distance.0)?;
            Some(Self { channels, after: Seconds(after) })
        };
        let ahead = pairs.filter_map(meeting).filter(|meeting| meeting.after <= horizon);
        ahead.min_by(|a, b| a.after.0.total_cmp(&b.after.0))
    }
}

/// Time until a distance that lies in 0 .. `period` and grows by `rate` is within `near` of 0 or of the
/// period.
fn time_to_meet(apart: f64, rate: f64, period: f64, near: f64) -> Option<f64> {
    if apart <= near || apart >= period - near {
        return Some(0.0);
    }
    let way = if rate > 0.0 { period - near - apart } else { apart - near };
    (rate != 0.0).then(|| way / rate.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn states(list: &[(f64, f64)]) -> Vec<DelayState> {
        let state =
            |&(delay, rate): &(f64, f64)| DelayState { rate, ..DelayState::known(Seconds(delay), 0.0, 0.0) };
        list.iter().map(state).collect()
    }

    fn ahead(list: &[(f64, f64)], horizon: f64) -> Option<([usize; 2], f64)> {
        let found = Coincidence::within(&states(list), Seconds(4.0), Seconds(0.25), Seconds(horizon));
        found.map(|found| (found.channels, found.after.0))
    }

    #[test]
    fn the_first_meeting_modulo_the_slow_period_is_found() {
        // 1 and 0 part, but meet again around the period: 4 - 0.25 - 1 at a rate of 0.5.
        assert_eq!(ahead(&[(0.0, 0.0), (1.0, 0.5)], 10.0), Some(([0, 1], 5.5)));
        assert_eq!(ahead(&[(0.0, 0.0), (1.0, 0.5)], 5.0), None);
        assert_eq!(ahead(&[(0.0, 0.0), (1.0, -0.5)], 10.0), Some(([0, 1], 1.5)));
        assert_eq!(ahead(&[(0.0, 0.0), (2.0, 0.0), (3.0, -0.5)], 10.0), Some(([1, 2], 1.5)));
        // Delays of whole periods more are the same.
        assert_eq!(ahead(&[(8.0, 0.0), (1.0, -0.5)], 10.0), Some(([0, 1], 1.5)));
        assert_eq!(ahead(&[(0.0, 0.0), (3.9, 0.0)], 0.0), Some(([0, 1], 0.0)));
        assert_eq!(ahead(&[(0.0, 0.0), (2.0, 0.0)], f64::INFINITY), None);
    }
}
