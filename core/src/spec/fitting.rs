//! The values of the channels that a calibration fits.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize, Serializer};

use super::{FilterSpec, SpecProblem};

/// A value of a channel that can be fitted.
///
/// ```
/// use hybank_core::spec::{Cutoff, Fitting, UnknownFitting};
/// assert_eq!("cutoff:2".parse(), Ok(Fitting::Cutoff(Cutoff::Stage(1))));
/// assert_eq!("phase".parse::<Fitting>(), Err(UnknownFitting));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
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
    pub fn scaled(self, filter: &FilterSpec, factor: f64) -> Option<FilterSpec> {
        match self {
            Self::Whole => Some(filter.with_cutoff_scaled(factor)),
            Self::Stage(stage) => filter.with_stage_scaled(stage, factor),
        }
    }
}

/// One factor of each channel scales one part of its front end.
pub(super) fn check(list: &[Fitting]) -> Result<(), SpecProblem> {
    let cutoffs: Vec<String> =
        list.iter().filter(|value| matches!(value, Fitting::Cutoff(_))).map(Fitting::to_string).collect();
    if cutoffs.len() < 2 {
        return Ok(());
    }
    let message = format!("{} have one factor for each channel; keep one of them", cutoffs.join(" and "));
    Err(SpecProblem::Value { message })
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

impl Serialize for Fitting {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl TryFrom<String> for Fitting {
    type Error = UnknownFitting;

    fn try_from(text: String) -> Result<Self, UnknownFitting> {
        text.parse()
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
    }
}
