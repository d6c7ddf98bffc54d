//! One-file captures on the command line: converters that take turns in one recording.

use super::Failure;
use crate::bank::Bank;
use crate::io::TimeInterleaving;
use crate::units::FastPeriods;
use std::path::Path;

/// The option of the commands that read captures of a bank.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct TurnArgs {
    /// The input is one recording of one channel in which M converters take turns: its sample k, counted
    /// from 0, comes from converter k mod M. Converters count in the order in which they sample, so
    /// converter 0 is the channel with the largest delay
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u16).range(1..=1024))]
    interleaved: Option<u16>,
}

impl TurnArgs {
    /// True if converters take turns.
    pub(super) fn is_given(self) -> bool {
        self.interleaved.is_some()
    }

    /// Refuses more than one input, before any file is read.
    pub(super) fn check(self, inputs: usize) -> Result<(), Failure> {
        match self.interleaved {
            Some(converters) if inputs != 1 => Err(Failure::Usage(format!(
                "--interleaved {converters} reads all converters from one recording, but {inputs} inputs are given; \
                 give one, or leave out --interleaved"
            ))),
            _ => Ok(()),
        }
    }

    /// The channels of `bank` in the order in which they sample, if they take turns.
    pub(super) fn turns(self, bank: &Bank, path: &Path) -> Result<Option<TimeInterleaving>, Failure> {
        self.by_delay(&bank.delays_in_fast_periods(), bank.ratio, path)
    }

    /// Channels of the given delays, with `ratio` fast periods per slow period, in the order in which they
    /// sample, if they take turns. `path` is the file that says so.
    pub(super) fn by_delay(
        self,
        delays: &[FastPeriods],
        ratio: usize,
        path: &Path,
    ) -> Result<Option<TimeInterleaving>, Failure> {
        let Some(converters) = self.interleaved else { return Ok(None) };
        let channels = delays.len();
        if channels != usize::from(converters) {
            return Err(Failure::Usage(format!(
                "--interleaved {converters}: {} has {channels} channels, and each of them is one converter; \
                 give --interleaved {channels}",
                path.display()
            )));
        }
        let delays: Vec<f64> = delays.iter().map(|delay| delay.0).collect();
        let apart = delays.iter().copied().fold(f64::NEG_INFINITY, f64::max)
            - delays.iter().copied().fold(f64::INFINITY, f64::min);
        if apart >= ratio as f64 {
            return Err(Failure::Input(format!(
                "{}: the delays lie {apart} fast periods apart, so converters with a slow period of {} do not \
                 sample in turn; give one recording per channel",
                path.display(),
                ratio
            )));
        }
        Ok(Some(TimeInterleaving::by_delay(&delays)))
    }
}
