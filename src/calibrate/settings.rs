//! What to fit, by which captures, relative to what.

use super::parameters::Fit;
use crate::units::{FastPeriods, Hertz};

/// The kind of signal that was captured.
#[derive(Debug, Clone, Copy)]
pub enum Evidence<'a> {
    /// Tones near these analog frequencies; an empty list for tones below half the fast rate that are to be
    /// found.
    Tones(&'a [Hertz]),
    /// The samples of a waveform, taken at 0, T, 2 T, .. It is band-limited, and where it lies in the
    /// captures is found.
    Waveform {
        /// The samples.
        samples: &'a [f64],
        /// T.
        spacing: FastPeriods,
    },
    /// Any signal.
    AnySignal,
}

/// What to fit, and relative to what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Settings {
    /// The values that are fitted.
    pub fit: Fit,
    /// The reference channel, from 0.
    pub reference: usize,
}
