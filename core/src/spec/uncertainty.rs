//! The `[uncertainty]` table: how well the values of the channels are known.

use serde::Serialize;

use super::error::At;
use super::limits::{range, within};
use super::{OneOrEach, SpecError, SpecProblem};
use crate::units::{FastPeriods, Seconds};

/// Half-width of the 95 % interval of a normal law over its standard deviation.
pub const HALF_WIDTH: f64 = 1.959_963_984_540_054;
/// Largest half-width of a delay in fast periods; nothing is known of a delay that may be off by more.
const MAX_DELAY: f64 = 1024.0;
/// Largest half-width of a gain or a cut-off: the proof of a worst case takes less than 50 %.
const MAX_SHARE: f64 = 0.49;
/// Largest half-width of an offset, of full scale.
const MAX_OFFSET: f64 = 1.0;

/// How well the values of the channels are known: half-widths of 95 % intervals beside the values of the
/// `[[channel]]` tables.
///
/// A channel's delay, gain and cut-off are relative to the reference channel: a delay or a gain that all
/// channels have in common cannot be observed.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct UncertaintySpec {
    /// Half-width of D_i in seconds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay: Option<OneOrEach<Seconds>>,
    /// Half-width of g_i, as a factor: 0.01 for a gain of 1 that may be 0.99 or 1.01.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<OneOrEach<f64>>,
    /// Half-width of o_i relative to full scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<OneOrEach<f64>>,
    /// Half-width of the cut-off frequency as a share of it: 0.02 is 2 %. Phi_i(s) may be Phi_i(s / (1 + x))
    /// for all |x| up to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cutoff: Option<OneOrEach<f64>>,
    /// The channel to which delays, gains and cut-offs are relative, from 1; 0 if every channel has an error
    /// of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<usize>,
}

/// One value per channel, of one for all or of a list; zeros where none is given.
///
/// # Errors
/// [`SpecProblem::Value`] for a list of another length.
pub fn for_channels<T: Copy + Default>(given: &[T], channels: usize) -> Result<Vec<T>, SpecProblem> {
    let remedy = "give one for each, or one for all";
    match given {
        [] => Ok(vec![T::default(); channels]),
        [all] => Ok(vec![*all; channels]),
        _ if given.len() == channels => Ok(given.to_vec()),
        _ => Err(SpecProblem::Value {
            message: format!("{} values are given for {channels} channels; {remedy}", given.len()),
        }),
    }
}

impl UncertaintySpec {
    /// The reference channel from 0: the first one unless the table names another; `None` where every
    /// channel has an error of its own.
    pub fn reference_channel(&self) -> Option<usize> {
        self.reference.unwrap_or(1).checked_sub(1)
    }

    /// Half-widths of all `channels` delays, 0 for the reference channel.
    pub fn delays(&self, channels: usize) -> Vec<Seconds> {
        self.relative(self.delay.as_ref(), channels)
    }

    /// Half-widths of all `channels` gains, 0 for the reference channel.
    pub fn gains(&self, channels: usize) -> Vec<f64> {
        self.relative(self.gain.as_ref(), channels)
    }

    /// Half-widths of all `channels` cut-offs, 0 for the reference channel.
    pub fn cutoffs(&self, channels: usize) -> Vec<f64> {
        self.relative(self.cutoff.as_ref(), channels)
    }

    /// Half-widths of all `channels` offsets.
    pub fn offsets(&self, channels: usize) -> Vec<f64> {
        (0..channels).map(|i| self.offset.as_ref().map_or(0.0, |offset| offset.of(i))).collect()
    }

    /// Whether a delay is uncertain.
    pub(super) fn has_delays(&self, channels: usize) -> bool {
        self.delays(channels).iter().any(|delay| *delay > Seconds(0.0))
    }

    /// Whether a delay or a gain is uncertain.
    pub(super) fn has_delays_or_gains(&self, channels: usize) -> bool {
        self.has_delays(channels) || self.gains(channels).iter().any(|gain| *gain > 0.0)
    }

    fn relative<T: Copy + Default>(&self, written: Option<&OneOrEach<T>>, channels: usize) -> Vec<T> {
        let exact = self.reference_channel();
        let of = |i| written.filter(|_| exact != Some(i)).map_or_else(T::default, |value| value.of(i));
        (0..channels).map(of).collect()
    }

    /// Checks all numbers for a spec of `channels` channels.
    pub(super) fn check(&self, channels: usize, h: Seconds) -> Result<(), SpecError> {
        let time = |value: &Seconds| check_delay_half_width(value.in_fast_periods(h), *value);
        check_list(self.delay.as_ref(), channels, time).at("delay")?;
        for (key, shares, most) in [
            ("gain", &self.gain, MAX_SHARE),
            ("offset", &self.offset, MAX_OFFSET),
            ("cutoff", &self.cutoff, MAX_SHARE),
        ] {
            let rule = format!("a half-width is zero or more and here at most {most}; 0.01 is one per cent");
            let share = |value: &f64| within(*value, 0.0..=most, "(half-width)", rule.as_str());
            check_list(shares.as_ref(), channels, share).at(key)?;
        }
        let rule = format!("the reference is one of the channels 1 to {channels}, or 0 for none");
        let reference = self.reference.unwrap_or(0) as f64;
        within(reference, 0.0..=channels as f64, "(channel)", rule).at("reference")
    }
}

/// A list has one entry per channel.
fn check_list<T>(
    written: Option<&OneOrEach<T>>,
    channels: usize,
    check: impl Fn(&T) -> Result<(), SpecProblem>,
) -> Result<(), SpecProblem> {
    let Some(written) = written else { return Ok(()) };
    if let OneOrEach::Each(list) = written
        && list.len() != channels
    {
        let rule = format!("give one number for all channels or a list with one for each of the {channels}");
        return Err(range(list.len() as f64, "entries", rule));
    }
    written.values().iter().try_for_each(check)
}

/// The half-width of a delay, as written and in fast periods.
///
/// # Errors
/// [`SpecProblem`] with the rule.
pub fn check_delay_half_width(periods: FastPeriods, written: Seconds) -> Result<(), SpecProblem> {
    if (0.0..=MAX_DELAY).contains(&periods.0) {
        return Ok(());
    }
    let rule = format!("a half-width is zero or more and at most {MAX_DELAY} fast periods; check its unit");
    Err(range(written.0, "s", rule))
}
