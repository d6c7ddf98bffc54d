//! A box of errors as it is asked for: half-widths, of one channel for all or of each.

use hybank_core::bank::Bank;
use hybank_core::quantity::WrittenTime;
use hybank_core::spec::{
    At, ErrorBox, SpecError, SpecProblem, check_delay_half_width, for_channels, refused,
};
use hybank_core::units::{FastPeriods, Seconds};
use std::str::FromStr;

/// Shares of this size and more are out of the range of the proof.
const MOST_SHARE: f64 = 0.5;

/// How far the channels may be off, in both directions. A list has no value, one for all channels but the
/// reference, or one for each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BoxWidths {
    /// By how much the delays may be off.
    pub delay_box: Vec<WrittenTime>,
    /// By which share the gains may be off.
    pub gain_box: Vec<f64>,
    /// By which share the cut-offs may be off.
    pub cutoff_box: Vec<f64>,
    /// The channel to which delays, gains and cut-offs are relative. Left out it is the first one where one
    /// value is given for all channels.
    pub reference: Option<ReferenceChannel>,
}

impl BoxWidths {
    /// Whether a box is asked for.
    pub fn has_box(&self) -> bool {
        !(self.delay_box.is_empty() && self.gain_box.is_empty() && self.cutoff_box.is_empty())
    }
}

/// What errors are relative to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReferenceChannel {
    /// Every channel has an error of its own.
    None,
    /// This channel, from 1, has none.
    Channel(usize),
}

/// A channel from 1, or `none`.
impl FromStr for ReferenceChannel {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.trim() {
            "none" => Ok(Self::None),
            text => match text.parse::<usize>() {
                Ok(channel) if channel > 0 => Ok(Self::Channel(channel)),
                _ => Err("the reference is a channel, counted from 1, or none"),
            },
        }
    }
}

impl BoxWidths {
    /// The box for the channels of `bank`; `None` if no width is given.
    ///
    /// # Errors
    /// [`SpecError`] with the field: widths out of their range, lists of another length, a reference that is
    /// not there.
    pub fn error_box(&self, bank: &Bank) -> Result<Option<ErrorBox>, SpecError> {
        let channels = bank.channel_count();
        if let Some(ReferenceChannel::Channel(channel)) = self.reference
            && !(1..=channels).contains(&channel)
        {
            let rule = format!("the bank has {channels} channels; give 1 to {channels}, or none");
            return Err(refused("reference", rule));
        }
        let delays = self.delay_box.iter().map(|time| checked(time.in_seconds(bank.fast_period), bank));
        let delays = delays.collect::<Result<Vec<FastPeriods>, SpecProblem>>().at("delay_box")?;
        self.gain_box.iter().try_for_each(check_share).at("gain_box")?;
        self.cutoff_box.iter().try_for_each(check_share).at("cutoff_box")?;
        let errors = ErrorBox {
            delays: self.relative(&delays, channels).at("delay_box")?,
            gains: self.relative(&self.gain_box, channels).at("gain_box")?,
            cutoffs: self.relative(&self.cutoff_box, channels).at("cutoff_box")?,
        };
        Ok(self.has_box().then_some(errors))
    }

    /// Values of all channels, 0 for the reference.
    fn relative<T: Copy + Default>(&self, given: &[T], channels: usize) -> Result<Vec<T>, SpecProblem> {
        let exact = match self.reference {
            Some(ReferenceChannel::None) => None,
            Some(ReferenceChannel::Channel(channel)) => Some(channel - 1),
            // A list says itself which channel is exact, and one channel alone is not relative to another.
            None => (given.len() == 1 && channels > 1).then_some(0),
        };
        let mut all = for_channels(given, channels)?;
        if let Some(exact) = exact {
            all[exact] = T::default();
        }
        Ok(all)
    }
}

fn checked(delay: Seconds, bank: &Bank) -> Result<FastPeriods, SpecProblem> {
    if delay.0 < 0.0 {
        return Err(negative());
    }
    let periods = delay.in_fast_periods(bank.fast_period);
    check_delay_half_width(periods, delay)?;
    Ok(periods)
}

fn check_share(share: &f64) -> Result<(), SpecProblem> {
    match *share {
        share if (0.0..MOST_SHARE).contains(&share) => Ok(()),
        share if share < 0.0 => Err(negative()),
        _ => Err(SpecProblem::Value { message: "shares of 50% and more are not supported".to_owned() }),
    }
}

fn negative() -> SpecProblem {
    let message = "the box reaches as far in both directions; give the positive half-width";
    SpecProblem::Value { message: message.to_owned() }
}
