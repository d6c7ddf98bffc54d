//! `hybank export`: a bank for other tools.

use super::bank_file::load;
use super::print::{Failure, InFile};
use super::written::{check_output, write_bytes};
use clap::ValueEnum;
use hybank::bank::{Bank, SynthesisFilters};
use hybank::design::analyze;
use hybank::interchange::{Format, block_of_sections, export, sections};
use hybank::messages::Quoted;
use std::path::PathBuf;

/// Writes a bank for other tools: C99, CSV, NumPy, MATLAB, FPGA memory
///
/// The order of FIR taps is the same in every format: channel, then phase of the output, then lag in slow
/// periods. coe and mem hold integer taps (`hybank design --bits`), and with offsets the constants that
/// their sums need, as comments. sos is a table of the second-order sections of a recursive bank at the
/// slow rate: the filter from a channel to a phase of the output is the sum of its sections z^-delay (b0 +
/// b1 z^-1 + b2 z^-2) / (a0 + a1 z^-1 + a2 z^-2). Its first line is a comment with the gamma of the
/// sections as they are written.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank export bank.json --to c -o bank.h
  hybank export bank.json -o bank.npz
  hybank export fixed.json -o taps.coe
  hybank export fixed.json -o bank.h --input-bits 12
  hybank export recursive.json --to sos -o sections.csv")]
pub(super) struct Args {
    /// The bank (JSON); `-` is standard input
    bank: PathBuf,
    /// The format [default: that of the output's extension: h, csv, npz, mat, coe or mem]
    #[arg(long, value_enum)]
    to: Option<Format>,
    /// The file to write; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Bits of the samples that integer code takes: offsets are relative to their full scale (c, coe, mem)
    #[arg(long, value_name = "B")]
    input_bits: Option<u32>,
    /// Prefix of the C identifiers
    #[arg(long, default_value = "bank")]
    name: String,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

impl Args {
    fn format(&self) -> Result<Format, Failure> {
        let extension = self.output.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        let extension = extension.to_ascii_lowercase();
        // A header is the only C that is written, and a table of sections has the ending of any CSV.
        let meant = match extension.as_str() {
            "h" => Some(Format::C99),
            name => Format::from_str(name, false)
                .ok()
                .filter(|format| !matches!(format, Format::C99 | Format::Sos)),
        };
        self.to.or(meant).ok_or_else(|| {
            let message = "the name does not say which format it is to have; give --to c, csv, npz, mat, coe, mem or sos";
            Failure::Usage(format!("{}: {message}", Quoted(&self.output)))
        })
    }
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let format = args.format()?;
    check_output(&args.output, &[&args.bank], args.force)?;
    let bank = load(&args.bank)?;
    let mut bytes = export(&bank, format, &args.name, args.input_bits).in_file(&args.bank)?;
    if format == Format::Sos {
        bytes.splice(0..0, gamma_of_sections(&bank).in_file(&args.bank)?.bytes());
    }
    write_bytes(&args.output, &bytes, args.force)
}

/// A line with the gamma of the numbers that were written; empty where the front ends are unknown.
fn gamma_of_sections(bank: &Bank) -> Result<String, Box<dyn std::error::Error>> {
    if bank.spec.is_none() {
        return Ok(String::new());
    }
    let block = block_of_sections(&sections(bank)?, bank.frame_samples(), bank.ratio);
    let written = Bank { filters: SynthesisFilters::StateSpace(block), ..bank.clone() };
    let gamma = analyze(&written, &[])?.gamma;
    let bank = bank.gamma.norm.map_or_else(String::new, |gamma| format!("; of the bank {gamma:e}"));
    Ok(format!("# gamma of these sections {gamma:e}{bank}; z^-1 is one slow period\n"))
}
