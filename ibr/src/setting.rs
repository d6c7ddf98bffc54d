//! Settings outside their range.

use hybank_core::messages::Number;

/// A number outside its range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{name} is {}: it must be {rule}", Number(*.value))]
pub struct SettingError {
    /// Name of the setting.
    pub name: &'static str,
    /// Value given.
    pub value: f64,
    /// The range in words.
    pub rule: &'static str,
}

/// A test of a number, and its range in words.
pub(crate) struct Rule {
    holds: fn(f64) -> bool,
    words: &'static str,
}

pub(crate) const FINITE: Rule = Rule { holds: f64::is_finite, words: "a finite number" };
pub(crate) const NOT_NEGATIVE: Rule =
    Rule { holds: |v| v.is_finite() && v >= 0.0, words: "a finite number >= 0" };
/// In square pixels, the row is flat over a thousand of them from there on, and at 1e13 samples no longer
/// count beside it.
pub(crate) const SMOOTHING: Rule =
    Rule { holds: |v| (0.0..=1e6).contains(&v), words: "a number from 0 to 1000000" };
pub(crate) const POSITIVE: Rule =
    Rule { holds: |v| v.is_finite() && v > 0.0, words: "a positive finite number" };
pub(crate) const SCALE: Rule = Rule {
    holds: |v| v.is_finite() && v > 0.0,
    words: "a positive number (stored value / scale = depth or disparity)",
};
pub(crate) const PIXELS: Rule = Rule { holds: f64::is_finite, words: "a finite number of pixels" };
pub(crate) const STEP: Rule = Rule { holds: |v| v >= 1.0, words: "at least 1 pixel" };
pub(crate) const SHARE: Rule = Rule { holds: |v| (0.0..=1.0).contains(&v), words: "a number from 0 to 1" };

impl Rule {
    /// Refuses a number outside the range.
    pub(crate) fn check(&self, name: &'static str, value: f64) -> Result<(), SettingError> {
        if (self.holds)(value) { Ok(()) } else { Err(SettingError { name, value, rule: self.words }) }
    }
}
