//! What tones say of the channels.

use crate::linalg::Complex;
use crate::sine_fit::Estimate;
use crate::units::{FastPeriods, Hertz};
use std::f64::consts::{PI, TAU};

/// A tone that was used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tone {
    /// Its analog frequency.
    pub frequency: Estimate<Hertz>,
    /// Its Nyquist zone of the slow rate, from 1: zone z lies between (z - 1)/2 and z/2 of the rate.
    pub zone: usize,
    /// Amplitude in the reference channel.
    pub amplitude: Estimate<f64>,
}

/// The distance of the delays that the tones do not tell apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Modulus(
    /// In fast periods; `None` if the tones leave no second value within a thousand periods of the highest.
    pub Option<FastPeriods>,
);

/// What one tone says of the channels.
pub(super) struct Measured {
    /// Rad per fast period.
    pub(super) w: f64,
    /// Cycles per slow sample.
    pub(super) cycles: f64,
    pub(super) frequency: Hertz,
    /// a_it / a_rt over the nominal ratio.
    pub(super) ratios: Vec<Complex<f64>>,
    /// Standard deviations of ln |ratio| and of its phase.
    pub(super) sigmas: Vec<(f64, f64)>,
}

/// An angle without whole turns, -pi to pi.
pub(super) fn wrapped(angle: f64) -> f64 {
    (angle - TAU * (angle / TAU).round()).clamp(-PI, PI)
}
