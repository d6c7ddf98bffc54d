//! How captures are read whose header does not say it, converters that take turns in one recording, and
//! whether captures fit the bank.

use super::output::WAV;
use super::print::{Failure, failed, failed_at, is_dash};
use super::table_args::TableArgs;
use hybank::bank::Bank;
use hybank::captures::{Converters, FileFormat};
use hybank::io::table::TableOptions;
use hybank::io::{Coding, MultiReader, ReadOptions, StatedScale, TimeInterleaving};
use hybank::messages::Quoted;
use hybank::pipeline::matching::{self, NotInTurn};
use hybank::quantity::{self, FullScale};
use std::path::Path;

/// Options of the commands that read captures.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct CaptureArgs {
    /// Sample format of captures: wav, csv, or a raw format as in ffmpeg (s16le, f32le, ..)
    ///
    /// With c before it it is one of complex samples: cf32, cs16.
    /// SigMF recordings, .csv, .npy, .mat (x.mat:name for one variable of several) and .flac state their
    /// own; a text of numbers is a table, whatever its name.
    #[arg(long, value_name = "FORMAT", default_value = "wav", value_parser = coding)]
    format: Coding,
    /// Interleaved channels of each raw capture [default: 1 each, or all in a single capture]
    #[arg(long, value_name = "C", value_parser = clap::value_parser!(u16).range(1..), hide_short_help = true)]
    channels: Option<u16>,
    /// Each pair of channels is a complex sample, as receivers write I and Q to WAV
    #[arg(long, hide_short_help = true)]
    iq: bool,
    #[command(flatten)]
    pub(super) scale: ScaleArgs,
    /// Use only this channel of each capture, from 1
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u16).range(1..), hide_short_help = true)]
    channel: Option<u16>,
    #[command(flatten)]
    pub(super) table: TableArgs,
}

/// Reads the name of a coding.
pub(super) fn coding(name: &str) -> Result<Coding, String> {
    name.parse()
        .map_err(|error| format!("{error}, wav, csv, or one of these with c before it for complex samples"))
}

impl CaptureArgs {
    /// Refuses impossible combinations; `takes_turns` with --interleaved.
    pub(super) fn check(&self, takes_turns: bool) -> Result<(), Failure> {
        if self.channel.is_some() && takes_turns {
            let message =
                "--channel and --interleaved: converters that take turns share one channel; extract it first";
            return Err(Failure::Usage(message.into()));
        }
        check_channels(self.channels, self.format)
    }

    /// For a recording that the one called `file` is compared with: what the options say of the format holds
    /// for both, unless its name says that it is WAV.
    pub(super) fn of_reference(&self, file: &Path, reference: &Path) -> ReadOptions<'static> {
        let ending = |path: &Path| path.extension().unwrap_or_default().to_ascii_lowercase();
        let own = self.format().options(1, 1);
        match (ending(file), ending(reference)) {
            (own_ending, ending) if own_ending == ending => own,
            (_, ending) if WAV.iter().any(|known| ending == *known) => ReadOptions::files(),
            _ => ReadOptions { scale: StatedScale::default(), ..own },
        }
    }

    /// Whether nothing is said of the captures.
    pub(super) fn is_default(&self) -> bool {
        let Self { format, channels, iq, scale, channel, table } = self;
        let is_said = channels.is_some() || *iq || scale.full_scale.is_some() || channel.is_some();
        *format == Coding::Wav && !is_said && table.options() == TableOptions::default()
    }

    /// What is said of captures that do not state their format.
    pub(super) fn format(&self) -> FileFormat {
        FileFormat {
            coding: self.format,
            channels: self.channels.map(usize::from),
            only: self.channel.map(|channel| usize::from(channel) - 1),
            is_iq: self.iq,
            full_scale: self.scale.full_scale,
            table: self.table.options(),
        }
    }
}

/// Refuses a number of channels for captures that state theirs.
pub(super) fn check_channels(channels: Option<u16>, format: Coding) -> Result<(), Failure> {
    match (channels, format) {
        (Some(_), Coding::Wav | Coding::Csv) => Err(Failure::Usage(
            "--channels: captures with headers state their channels; give the --format of raw captures"
                .into(),
        )),
        _ => Ok(()),
    }
}

/// The full scale of captures.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct ScaleArgs {
    /// Full scale of the converters: codes (12bits, u12bits) or a number [default: that of the file or spec]
    ///
    /// The codes of 12bits are from -2048 to 2047, those of u12bits from 0 to 4095, in words of any size. By
    /// default it is that of WAV and FLAC files, else that of the spec or its bits, else all bits of
    /// integers, or 1.
    #[arg(long, value_name = "X", value_parser = quantity::full_scale)]
    pub(super) full_scale: Option<FullScale>,
}

/// The option of the commands that read captures of a bank.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct InterleavedArgs {
    /// The input is one recording of one channel in which M converters take turns
    ///
    /// Its sample k, counted from 0, comes from converter k mod M. Converters count in the order in which
    /// they sample, so converter 0 is the channel with the largest delay.
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u16).range(1..=1024))]
    interleaved: Option<u16>,
}

impl InterleavedArgs {
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

    /// The order in which the converters of the bank or the spec in the file `path` sample, if they take
    /// turns.
    pub(super) fn interleaving(
        self,
        of: &Converters<'_>,
        path: &Path,
    ) -> Result<Option<TimeInterleaving>, Failure> {
        let Some(converters) = self.interleaved else { return Ok(None) };
        of.interleaving(converters.into()).map(Some).map_err(|problem| match problem {
            NotInTurn::Apart { .. } => failed_at(path, problem),
            _ => Failure::Usage(format!("--interleaved {converters}: {}: {problem}", Quoted(path))),
        })
    }
}

/// `-` may be given once.
pub(super) fn check_stdin<'a>(inputs: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
    if inputs.filter(|path| is_dash(path)).count() > 1 {
        return Err(Failure::Usage("`-` is given twice; standard input can be only one of them".into()));
    }
    Ok(())
}

/// The inputs together have the channels of the bank in the file `path`; the rate of the output in hertz.
pub(super) fn output_rate(bank: &Bank, path: &Path, reader: &MultiReader) -> Result<f64, Failure> {
    matching::check_channels(&bank.layout(), &path.display().to_string(), reader).map_err(failed)?;
    matching::output_rate(bank, reader).map_err(failed)
}
