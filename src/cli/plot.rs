//! `hybank plot`: a bank as pictures.

use super::Failure;
use super::bank_file::{begin_file, load, name};
use super::folder::write_together;
use super::picture_format::PictureFormat;
use super::say::name_leftovers;
use super::sweeps::sweeps;
use crate::files::refuse_overlaps;
use crate::overview::{Picture, pictures};
use std::path::{Path, PathBuf};

/// Draws the front ends, the filters and the error of a bank
///
/// Writes nine pictures: tones, front-ends, analysis, filters, phase, group-delay, impulse-responses, error
/// and delay-error. The first one shows the largest image and the error of gain of a tone, by its
/// frequency. The error is the largest gain from the analog input to the error, by frequency modulo the
/// slow rate; its maximum is gamma.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank plot bank.json -o pictures
  hybank plot bank.json -o pictures --sweeps --force
  hybank plot bank.json -o pictures --format png")]
pub(super) struct Args {
    /// The bank (JSON)
    bank: PathBuf,
    /// The folder for the pictures; created if missing
    #[arg(short, long)]
    output: PathBuf,
    /// Format of the pictures
    #[arg(long, value_enum, default_value_t = PictureFormat::Svg)]
    format: PictureFormat,
    /// Draw gamma against latency too, and for FIR banks against taps. This designs some twenty further
    /// banks
    #[arg(long)]
    sweeps: bool,
    /// Replace existing pictures
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let bank = load(&args.bank)?;
    let named = |error: &dyn std::fmt::Display| Failure::Input(format!("{}: {error}", name(&args.bank)));
    let mut files = Vec::new();
    let mut all = pictures(&bank).map_err(|error| named(&error))?;
    if args.sweeps {
        all.extend(sweeps(&bank).map_err(|error| named(&error))?);
    }
    for Picture { name, chart, .. } in all {
        let picture = args.format.file(&chart, &[]).map_err(|error| named(&error))?;
        files.push((args.output.join(format!("{name}.{}", args.format.extension())), picture));
    }
    write_all(args, &files)?;
    let lines: String = files.iter().map(|(path, _)| format!("{}\n", path.display())).collect();
    super::print(&lines)
}

/// The pictures appear together.
fn write_all(args: &Args, pictures: &[(PathBuf, Vec<u8>)]) -> Result<(), Failure> {
    let paths: Vec<&Path> = pictures.iter().map(|(path, _)| path.as_path()).collect();
    refuse_overlaps(&paths, &[&args.bank]).map_err(Failure::input)?;
    name_leftovers(&paths);
    write_together(&args.output, pictures.iter().map(Ok), |(path, bytes)| {
        Ok(vec![begin_file(path, bytes, args.force)?])
    })
}
