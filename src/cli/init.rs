//! `hybank init`: a commented spec to begin with.

use super::Failure;
use super::bank_file::write_text;
use std::path::PathBuf;

/// Writes a commented spec to begin with
///
/// The spec is complete: `hybank design` accepts it as it is. `hybank help spec` explains every key.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank init -o spec.toml
  hybank init --example audio-2x -o spec.toml")]
pub(super) struct Args {
    /// What the spec describes
    #[arg(long, value_enum, default_value_t = Example::TiAdc)]
    example: Example,
    /// The spec (TOML); `-` is standard output
    #[arg(short, long, default_value = "-")]
    output: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Example {
    /// Four time-interleaved converters with a few picoseconds of skew
    TiAdc,
    /// Two audio recorders, one a fraction of a sample late
    #[value(name = "audio-2x")]
    Audio2x,
    /// Fewer slow sensor samples than output samples
    SensorArray,
    /// More converters than needed: three for a ratio of two
    Oversampled,
    /// The example of the thesis, in normalised time
    Thesis,
}

impl Example {
    fn text(self) -> &'static str {
        match self {
            Self::TiAdc => include_str!("../../filters/interleaved-4x250M.toml"),
            Self::Audio2x => include_str!("../../filters/speech-2x.toml"),
            Self::SensorArray => include_str!("../../filters/vibration-3x.toml"),
            Self::Oversampled => include_str!("../../filters/oversampled-3for2.toml"),
            Self::Thesis => include_str!("../../filters/thesis-fir.toml"),
        }
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    write_text(&args.output, args.example.text(), args.force)
}
