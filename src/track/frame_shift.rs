//! Delays that move by more than a slow period.
//!
//! With its frames counted from s samples further on, a channel's delay is smaller by s slow periods. So
//! taps that were designed for all delays of one slow period serve every delay, if the frames are shifted
//! as it moves on.

use crate::units::Seconds;

/// By how much a box must be wider than a slow period on each side, in slow periods: then a delay that was
/// shifted from one end lies so far within the other one that its noise does not shift it back.
const LEAST_OVERLAP: f64 = 0.01;
/// No delay is shifted by more frames: some minutes.
const MOST_FRAMES: f64 = (1u32 << 23) as f64;

/// Half the box of a delay from which on it holds all delays up to whole slow periods.
pub(super) fn least_half(slow_period: Seconds) -> Seconds {
    slow_period * (0.5 + LEAST_OVERLAP)
}

/// The shift s for which `error - s slow_period` lies in the box, where the shift was `before`: the same as
/// long as it may be, else the one that brings the delay nearest to the centre.
pub(super) fn shift_for(error: Seconds, half: Seconds, slow_period: Seconds, before: i64) -> i64 {
    if half < least_half(slow_period) {
        return before;
    }
    let most = 0.5 * (half.0 + 0.5 * slow_period.0);
    let rest = error.0 - before as f64 * slow_period.0;
    if rest.abs() <= most {
        return before;
    }
    (error.0 / slow_period.0).round().clamp(-MOST_FRAMES, MOST_FRAMES) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow period of 2 s.
    fn shift(error: f64, half: f64, before: i64) -> i64 {
        shift_for(Seconds(error), Seconds(half), Seconds(2.0), before)
    }

    #[test]
    fn a_delay_is_shifted_near_the_end_of_the_box_and_not_back_at_once() {
        // Between 1 and 1.2, half a slow period and the box.
        assert_eq!((shift(1.09, 1.2, 0), shift(1.11, 1.2, 0)), (0, 1));
        assert_eq!((shift(0.91, 1.2, 1), shift(0.89, 1.2, 1)), (1, 0));
        assert_eq!((shift(-1.09, 1.2, 0), shift(-1.11, 1.2, 0)), (0, -1));
        // Jumps too.
        assert_eq!((shift(37.2, 1.2, 0), shift(-4.9, 1.2, 7)), (19, -2));
        assert_eq!(shift(f64::INFINITY, 1.2, 0), 1 << 23);
        // Whatever the delay, it is in the box then.
        for k in -500..500 {
            let error = 0.037 * f64::from(k);
            for before in -3..3 {
                assert!((error - 2.0 * shift(error, 1.2, before) as f64).abs() <= 1.2);
            }
        }
    }

    #[test]
    fn a_box_without_a_whole_period_shifts_nothing() {
        assert_eq!((shift(5.0, 1.0, 0), shift(5.0, 0.3, 2)), (0, 2));
    }
}
