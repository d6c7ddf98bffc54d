//! The flags that name how far the channels may be off.

use super::Failure;
use crate::bank::Bank;
use crate::quantity::{self, Time};
use crate::units::Seconds;
use crate::verify::uncertainty::ErrorBox;

// Not a doc comment: clap would show it as the text of the whole command.
#[derive(Debug, clap::Args)]
pub(super) struct Flags {
    /// Prove the worst case over delays that are off by up to this much (10ps, 0.01samples, or seconds): one
    /// value for all channels but the reference, or one per channel
    #[arg(long, value_delimiter = ',', value_parser = time)]
    delay_box: Vec<Time>,
    /// Also gains that are off by up to this share (1%, 500ppm, 0.01); values as for --delay-box
    #[arg(long, value_delimiter = ',', value_parser = share)]
    gain_box: Vec<f64>,
    /// Also cut-offs that are off by up to this share; values as for --delay-box
    #[arg(long, value_delimiter = ',', value_parser = share)]
    cutoff_box: Vec<f64>,
    /// Also bound what instants that jitter by up to this much may add: one value, or one per channel
    #[arg(long, value_delimiter = ',', value_parser = time)]
    jitter: Vec<Time>,
    /// The channel to which delays, gains and cut-offs are relative, from 1, or none if every channel has an
    /// error of its own [default: 1 where one value is given for all channels]
    #[arg(long, value_name = "CHANNEL|none", value_parser = reference)]
    reference: Option<Reference>,
}

/// The reference channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reference {
    None,
    /// From 1.
    Channel(usize),
}

fn reference(text: &str) -> Result<Reference, String> {
    match text.trim() {
        "none" => Ok(Reference::None),
        text => match text.parse::<usize>() {
            Ok(channel) if channel > 0 => Ok(Reference::Channel(channel)),
            _ => Err("the reference is a channel, counted from 1, or none".to_owned()),
        },
    }
}

fn time(text: &str) -> Result<Time, String> {
    let time = quantity::time(text).map_err(|error| error.to_string())?;
    if time.in_seconds(Seconds(1.0)).0 >= 0.0 { Ok(time) } else { Err(NEGATIVE.to_owned()) }
}

fn share(text: &str) -> Result<f64, String> {
    match quantity::relative(text).map_err(|error| error.to_string())? {
        share if (0.0..0.5).contains(&share) => Ok(share),
        share if share < 0.0 => Err(NEGATIVE.to_owned()),
        _ => Err("shares of 50% and more are not supported".to_owned()),
    }
}

const NEGATIVE: &str = "the box reaches as far in both directions; give the positive half-width";

impl Flags {
    /// Whether a box is asked for.
    pub(super) fn is_given(&self) -> bool {
        !(self.delay_box.is_empty() && self.gain_box.is_empty() && self.cutoff_box.is_empty())
    }

    /// Whether a bound of jitter is asked for.
    pub(super) fn has_jitter(&self) -> bool {
        !self.jitter.is_empty()
    }

    /// The box for the channels of `bank`.
    ///
    /// # Errors
    /// [`Failure::Usage`] for lists of another length and for a reference that is not there.
    pub(super) fn error_box(&self, bank: &Bank) -> Result<ErrorBox, Failure> {
        let channels = bank.channel_count();
        if let Some(Reference::Channel(channel)) = self.reference
            && channel > channels
        {
            let message = format!(
                "--reference {channel}: the bank has {channels} channels; give 1 to {channels}, or none"
            );
            return Err(Failure::Usage(message));
        }
        let delays: Vec<Seconds> =
            self.delay_box.iter().map(|time| time.in_seconds(bank.fast_period)).collect();
        Ok(ErrorBox {
            delays: self.spread("--delay-box", &delays, channels)?,
            gains: self.spread("--gain-box", &self.gain_box, channels)?,
            cutoffs: self.spread("--cutoff-box", &self.cutoff_box, channels)?,
        })
    }

    /// Largest jitter of each channel.
    ///
    /// # Errors
    /// [`Failure::Usage`] for a list of another length.
    pub(super) fn jitter(&self, bank: &Bank) -> Result<Vec<Seconds>, Failure> {
        let channels = bank.channel_count();
        let times: Vec<Seconds> = self.jitter.iter().map(|time| time.in_seconds(bank.fast_period)).collect();
        match times[..] {
            [] => Ok(vec![Seconds(0.0); channels]),
            [one] => Ok(vec![one; channels]),
            _ if times.len() == channels => Ok(times),
            _ => Err(wrong_count("--jitter", times.len(), channels)),
        }
    }

    fn spread<T: Copy + Default>(&self, flag: &str, given: &[T], channels: usize) -> Result<Vec<T>, Failure> {
        let exact = match self.reference {
            Some(Reference::None) => None,
            Some(Reference::Channel(channel)) => Some(channel - 1),
            // A list says itself which channel is exact, and one channel alone is not relative to another.
            None => (given.len() == 1 && channels > 1).then_some(0),
        };
        let mut all = match given {
            [] => vec![T::default(); channels],
            [one] => vec![*one; channels],
            list if list.len() == channels => list.to_vec(),
            list => return Err(wrong_count(flag, list.len(), channels)),
        };
        if let Some(exact) = exact {
            all[exact] = T::default();
        }
        Ok(all)
    }
}

fn wrong_count(flag: &str, given: usize, channels: usize) -> Failure {
    Failure::Usage(format!(
        "{flag} has {given} values, but the bank has {channels} channels; give one value or {channels}"
    ))
}
