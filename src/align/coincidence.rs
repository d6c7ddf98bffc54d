//! Delays that come together: there two channels carry one measurement, and no bank recovers what the other
//! one carried.

use super::AlignedChannel;
use crate::spec::Spec;
use crate::units::Seconds;

/// Delays closer than this share of a fast period are together.
const TOGETHER_DELAY: f64 = 0.05;

/// The first two channels, from 0, that sample at one instant of the slow period within the time `lasts`, at
/// their present drifts, and when.
pub(super) fn first_coincidence(
    spec: &Spec,
    channels: &[AlignedChannel],
    lasts: Seconds,
) -> Option<([usize; 2], Seconds)> {
    let (slow_period, near) = (spec.fast_period * spec.ratio as f64, spec.fast_period * TOGETHER_DELAY);
    let pairs = (0..channels.len()).flat_map(|i| (0..i).map(move |j| [j, i]));
    let meeting = |pair: [usize; 2]| {
        let [a, b] = pair.map(|i| &channels[i]);
        let apart = (b.delay.value - a.delay.value).0.rem_euclid(slow_period.0);
        let after = time_to_meet(apart, b.drift.value - a.drift.value, slow_period.0, near.0)?;
        Some((pair, Seconds(after)))
    };
    let ahead = pairs.filter_map(meeting).filter(|(_, after)| *after <= lasts);
    ahead.min_by(|a, b| a.1.0.total_cmp(&b.1.0))
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

    #[test]
    fn the_next_meeting_is_around_the_period_or_at_zero() {
        // 1 grows by 0.5 to 4 - 0.25, or falls to 0.25.
        assert_eq!(time_to_meet(1.0, 0.5, 4.0, 0.25), Some(5.5));
        assert_eq!(time_to_meet(1.0, -0.5, 4.0, 0.25), Some(1.5));
        assert_eq!(time_to_meet(3.9, 0.0, 4.0, 0.25), Some(0.0));
        assert_eq!(time_to_meet(2.0, 0.0, 4.0, 0.25), None);
    }
}
