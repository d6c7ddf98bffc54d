//! What a calibration fits.

use crate::sine_fit::CurveKind;
use crate::spec::{Cutoff, Fitting};
use std::fmt;

/// Which values of the channels are fitted; the others keep those of the spec.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FittedValues {
    /// Delays.
    pub delay: bool,
    /// Gains.
    pub gain: bool,
    /// Offsets.
    pub offset: bool,
    /// Cut-off frequencies of the front ends.
    pub cutoff: Option<Cutoff>,
    /// The kind of the static nonlinearity, by tones only.
    pub nonlinearity: Option<CurveKind>,
}

impl Default for FittedValues {
    /// Delays, gains and offsets.
    fn default() -> Self {
        Self { delay: true, gain: true, offset: true, cutoff: None, nonlinearity: None }
    }
}

impl FittedValues {
    /// Nothing.
    pub const NOTHING: Self =
        Self { delay: false, gain: false, offset: false, cutoff: None, nonlinearity: None };

    /// The fitted parameters of a channel that is not the reference.
    pub(super) fn kinds(self) -> Vec<ChannelParameter> {
        let all = [
            (self.delay, ChannelParameter::Delay),
            (self.gain, ChannelParameter::Gain),
            (self.cutoff.is_some(), ChannelParameter::Cutoff),
        ];
        all.into_iter().filter_map(|(is_fitted, kind)| is_fitted.then_some(kind)).collect()
    }

    /// This with one more value. Of several parts of the front ends the last one counts.
    #[must_use]
    pub fn with(mut self, value: Fitting) -> Self {
        match value {
            Fitting::Delay => self.delay = true,
            Fitting::Gain => self.gain = true,
            Fitting::Offset => self.offset = true,
            Fitting::Cutoff(cutoff) => self.cutoff = Some(cutoff),
        }
        self
    }
}

/// These values and no others.
impl FromIterator<Fitting> for FittedValues {
    fn from_iter<I: IntoIterator<Item = Fitting>>(values: I) -> Self {
        values.into_iter().fold(Self::NOTHING, Self::with)
    }
}

/// The names of what is fitted, with commas, as in `delay,gain,cutoff:2`.
impl fmt::Display for FittedValues {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flags =
            [(self.delay, Fitting::Delay), (self.gain, Fitting::Gain), (self.offset, Fitting::Offset)];
        let flags = flags.into_iter().filter_map(|(is_fitted, value)| is_fitted.then_some(value));
        let names = flags.chain(self.cutoff.map(Fitting::Cutoff)).map(|value| value.to_string());
        f.write_str(&names.collect::<Vec<_>>().join(","))
    }
}

/// A parameter of a channel. Gains and cut-offs are fitted by their logarithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ChannelParameter {
    Delay,
    Gain,
    Cutoff,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_fitted_has_the_names_of_its_values() {
        let fit: FittedValues = [Fitting::Cutoff(Cutoff::Stage(1)), Fitting::Delay].into_iter().collect();
        assert_eq!(fit.to_string(), "delay,cutoff:2");
    }
}
