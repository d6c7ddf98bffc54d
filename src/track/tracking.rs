//! How delays are followed.

use super::TrackError;

/// Least frames of a measurement.
const LEAST_FRAMES: usize = 256;
/// The rates of clocks at the beginning, over how far they wander in a second.
const FIRST_RATE: f64 = 100.0;

/// How delays are followed. A spec in normalised time counts in its own unit of time in place of seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracking {
    /// Frames of one measurement.
    pub frames: usize,
    /// By how many parts per million the rate of a clock may wander in a second.
    pub wander: f64,
}

impl Default for Tracking {
    fn default() -> Self {
        Self { frames: 2048, wander: 1.0 }
    }
}

impl Tracking {
    /// # Errors
    /// [`TrackError::Frames`] and [`TrackError::Wander`].
    pub(super) fn check(&self) -> Result<(), TrackError> {
        if self.frames < LEAST_FRAMES {
            return Err(TrackError::Frames { given: self.frames, least: LEAST_FRAMES });
        }
        let is_rate = self.wander > 0.0 && self.wander < 1e6;
        if is_rate { Ok(()) } else { Err(TrackError::Wander { given: self.wander }) }
    }

    /// By how much a rate changes in a second at most, for the bound of the error between readings; it
    /// changes nothing else.
    pub(super) fn rate_change(&self) -> f64 {
        1e-6 * self.wander
    }

    /// Variance by which a rate walks in a second, in (s/s)^2 / s.
    pub(super) fn rate_walk(&self) -> f64 {
        self.rate_change().powi(2)
    }

    /// Standard deviation of the rates at the beginning, seconds per second.
    pub(super) fn rate_deviation(&self) -> f64 {
        FIRST_RATE * self.rate_change()
    }
}
