//! `hybank export`: a bank for other tools.

use super::Failure;
use super::bank_file::{load, refuse_overlap, write_bytes};
use crate::interchange::{Format, export};
use std::path::PathBuf;

/// Writes a bank for other tools: C99, CSV, NumPy, MATLAB, FPGA memory
///
/// The order of FIR taps is the same in every format: channel, then phase of the output, then lag in slow
/// periods. coe and mem hold integer taps (`hybank design --bits`).
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank export bank.json --to c -o bank.h
  hybank export bank.json --to npz -o bank.npz
  hybank export fixed.json --to coe -o taps.coe")]
pub(super) struct Args {
    /// The bank (JSON); `-` is standard input
    bank: PathBuf,
    /// The format
    #[arg(long, value_enum)]
    to: FormatArg,
    /// The file to write; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Prefix of the C identifiers
    #[arg(long, default_value = "bank")]
    name: String,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FormatArg {
    /// A C99 header with a streaming function
    C,
    /// Comma-separated values, one coefficient a line
    Csv,
    /// A NumPy archive
    Npz,
    /// A MATLAB file (level 4)
    Mat,
    /// A coefficient file of Xilinx tools
    Coe,
    /// Hexadecimal words for $readmemh
    Mem,
}

impl From<FormatArg> for Format {
    fn from(format: FormatArg) -> Self {
        match format {
            FormatArg::C => Self::C99,
            FormatArg::Csv => Self::Csv,
            FormatArg::Npz => Self::Npz,
            FormatArg::Mat => Self::Mat,
            FormatArg::Coe => Self::Coe,
            FormatArg::Mem => Self::Mem,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    refuse_overlap(&args.output, &args.bank)?;
    let bank = load(&args.bank)?;
    let bytes = export(&bank, args.to.into(), &args.name)
        .map_err(|error| Failure::Input(format!("{}: {error}", args.bank.display())))?;
    write_bytes(&args.output, &bytes, args.force)
}
