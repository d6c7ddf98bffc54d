//! What a calibration fits.

use crate::spec::FilterSpec;
use std::fmt;
use std::str::FromStr;

/// Which values of the channels are fitted; the others keep those of the spec.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fit {
    /// Delays.
    pub delay: bool,
    /// Gains.
    pub gain: bool,
    /// Offsets.
    pub offset: bool,
    /// Cut-off frequencies of the front ends.
    pub cutoff: Option<Cutoff>,
}

impl Default for Fit {
    /// Delays, gains and offsets.
    fn default() -> Self {
        Self { delay: true, gain: true, offset: true, cutoff: None }
    }
}

impl Fit {
    /// Nothing.
    pub const NOTHING: Self = Self { delay: false, gain: false, offset: false, cutoff: None };

    /// The fitted parameters of a channel that is not the reference.
    pub(super) fn kinds(self) -> Vec<Kind> {
        let all = [(self.delay, Kind::Delay), (self.gain, Kind::Gain), (self.cutoff.is_some(), Kind::Cutoff)];
        all.into_iter().filter_map(|(is_fitted, kind)| is_fitted.then_some(kind)).collect()
    }

    /// This with one more value.
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

/// The names of what is fitted, with commas, as in `delay,gain,cutoff:2`.
impl fmt::Display for Fit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flags =
            [(self.delay, Fitting::Delay), (self.gain, Fitting::Gain), (self.offset, Fitting::Offset)];
        let flags = flags.into_iter().filter_map(|(is_fitted, value)| is_fitted.then_some(value));
        let names = flags.chain(self.cutoff.map(Fitting::Cutoff)).map(|value| value.to_string());
        f.write_str(&names.collect::<Vec<_>>().join(","))
    }
}

/// A value of a channel that can be fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fitting {
    /// The delay.
    Delay,
    /// The gain.
    Gain,
    /// The offset.
    Offset,
    /// The cut-off frequency of the front end, or of a part of it.
    Cutoff(Cutoff),
}

/// The part of a front end whose frequencies one factor scales.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cutoff {
    /// The whole filter.
    Whole,
    /// One stage of a cascade, from 0.
    Stage(usize),
}

impl Cutoff {
    /// `filter` with the frequencies of this part multiplied by `factor`; `None` if it has no such stage.
    pub(super) fn scaled(self, filter: &FilterSpec, factor: f64) -> Option<FilterSpec> {
        match self {
            Self::Whole => Some(filter.with_cutoff_scaled(factor)),
            Self::Stage(stage) => filter.with_stage_scaled(stage, factor),
        }
    }
}

/// As it is written: `cutoff`, or `cutoff:2` for the second stage.
impl fmt::Display for Fitting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Delay => f.write_str("delay"),
            Self::Gain => f.write_str("gain"),
            Self::Offset => f.write_str("offset"),
            Self::Cutoff(Cutoff::Whole) => f.write_str("cutoff"),
            Self::Cutoff(Cutoff::Stage(stage)) => write!(f, "cutoff:{}", stage + 1),
        }
    }
}

impl FromStr for Fitting {
    type Err = UnknownFitting;

    fn from_str(text: &str) -> Result<Self, UnknownFitting> {
        let stage = |text: &str| text.parse::<usize>().ok()?.checked_sub(1);
        match (text, text.strip_prefix("cutoff:").and_then(stage)) {
            (_, Some(stage)) => Ok(Self::Cutoff(Cutoff::Stage(stage))),
            ("delay", _) => Ok(Self::Delay),
            ("gain", _) => Ok(Self::Gain),
            ("offset", _) => Ok(Self::Offset),
            ("cutoff", _) => Ok(Self::Cutoff(Cutoff::Whole)),
            _ => Err(UnknownFitting),
        }
    }
}

/// A name that is none of a value that can be fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "delay, gain, offset and cutoff can be fitted, and cutoff:2 for the second stage of the filters' cascades"
)]
pub struct UnknownFitting;

/// A parameter of a channel. Gains and cut-offs are fitted by their logarithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Delay,
    Gain,
    Cutoff,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_go_both_ways_and_a_wrong_one_is_refused() {
        for name in ["delay", "gain", "offset", "cutoff", "cutoff:1", "cutoff:12"] {
            assert_eq!(name.parse::<Fitting>().unwrap().to_string(), name);
        }
        for wrong in ["", "cutoff:", "cutoff:0", "cutoff:-1", "cutoff:99999999999999999999", "delays"] {
            assert_eq!(wrong.parse::<Fitting>(), Err(UnknownFitting), "{wrong}");
        }
        let fit = Fit::NOTHING.with(Fitting::Cutoff(Cutoff::Stage(1))).with(Fitting::Delay);
        assert_eq!(fit.to_string(), "delay,cutoff:2");
    }
}
