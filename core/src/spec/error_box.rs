//! Errors of the channels in normalised time: a box of them, and its points.

use super::Spec;
use crate::units::{FastPeriods, Seconds};
use serde::Serialize;

/// Errors of the channels. All lists have one entry per channel; `T` is the unit of the delays.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorPoint<T = FastPeriods> {
    /// True delay minus the one in the spec.
    pub delays: Vec<T>,
    /// True gain over the one in the spec, minus one.
    pub gains: Vec<f64>,
    /// True cut-off over the one in the spec, minus one.
    pub cutoffs: Vec<f64>,
}

/// How far the channels may be off, in both directions: the largest size of each error, below 0.5 for a
/// cut-off, which may be that of Phi_i(s / (1 + x)) for all |x| up to it.
pub type ErrorBox<T = FastPeriods> = ErrorPoint<T>;

/// Errors of one converter, or their half-widths.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ConverterErrors {
    /// Of the delay.
    pub delay: FastPeriods,
    /// Of the gain, relative.
    pub gain: f64,
    /// Of the cut-off, relative.
    pub cutoff: f64,
}

impl ErrorPoint {
    /// The number of errors that are not zero.
    pub fn sides(&self) -> usize {
        let shares = self.gains.iter().chain(&self.cutoffs).copied();
        self.delays.iter().map(|delay| delay.0).chain(shares).filter(|half| *half != 0.0).count()
    }

    /// No errors.
    pub fn none(channels: usize) -> Self {
        let zeros = vec![0.0; channels];
        Self { delays: vec![FastPeriods(0.0); channels], gains: zeros.clone(), cutoffs: zeros }
    }

    /// The errors of converter `i`.
    pub fn of(&self, i: usize) -> ConverterErrors {
        ConverterErrors { delay: self.delays[i], gain: self.gains[i], cutoff: self.cutoffs[i] }
    }

    /// Errors of the delays alone.
    pub fn of_delays(delays: Vec<FastPeriods>) -> Self {
        let channels = delays.len();
        Self { delays, ..Self::none(channels) }
    }

    /// The same errors with delays in seconds.
    pub fn in_seconds(&self, h: Seconds) -> ErrorPoint<Seconds> {
        let Self { delays, gains, cutoffs } = self.clone();
        ErrorPoint { delays: in_seconds(delays, h), gains, cutoffs }
    }
}

fn in_seconds(delays: Vec<FastPeriods>, h: Seconds) -> Vec<Seconds> {
    delays.into_iter().map(|delay| delay.in_seconds(h)).collect()
}

impl Spec {
    /// The box of the `[uncertainty]`, if there is one.
    pub fn error_box(&self) -> Option<ErrorBox> {
        let (table, channels) = (self.uncertainty.as_ref()?, self.channels.len());
        let delays = table.delays(channels).into_iter().map(|delay| delay.in_fast_periods(self.fast_period));
        Some(ErrorBox {
            delays: delays.collect(),
            gains: table.gains(channels),
            cutoffs: table.cutoffs(channels),
        })
    }

    /// The spec of converters with these errors.
    #[must_use]
    pub fn with_errors(&self, point: &ErrorPoint) -> Self {
        let mut moved = self.clone();
        for (i, channel) in moved.channels.iter_mut().enumerate() {
            channel.delay += point.delays[i].in_seconds(self.fast_period);
            channel.gain *= 1.0 + point.gains[i];
            if point.cutoffs[i] != 0.0 {
                channel.filter = channel.filter.with_cutoff_scaled(1.0 + point.cutoffs[i]);
            }
        }
        moved
    }
}
