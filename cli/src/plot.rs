//! `hybank plot`: a bank as pictures, and the files of pictures.

use super::bank_file::load;
use super::print::{Failure, InFile, print};
use super::written::{begin_file, check_folder, check_outputs, write_bytes, write_together};
use hybank::messages::Quoted;
use hybank::overview::{Picture, pictures};
use hybank::plot::Chart;
use std::path::{Path, PathBuf};

/// Draws the front ends, the filters and the error of a bank
///
/// Writes nine pictures: tones, front-ends, analysis, filters, phase, group-delay, impulse-responses, error
/// and delay-error. The first one shows the largest image and the error of gain of a tone, by its
/// frequency. The error is the largest gain from the signal's source to the error, by frequency modulo the
/// slow rate; its maximum is gamma.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank plot bank.json -o pictures
  hybank plot bank.json -o pictures --force")]
pub(super) struct Args {
    /// The bank (JSON)
    bank: PathBuf,
    /// The folder for the pictures; created if missing
    #[arg(short, long)]
    output: PathBuf,
    /// Replace existing pictures
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    check_folder(&args.output)?;
    let bank = load(&args.bank)?;
    let mut files = Vec::new();
    for Picture { name, chart, .. } in pictures(&bank).in_file(&args.bank)? {
        let picture = chart.to_svg().in_file(&args.bank)?.into_bytes();
        files.push((args.output.join(format!("{name}.svg")), picture));
    }
    let paths: Vec<&Path> = files.iter().map(|(path, _)| path.as_path()).collect();
    check_outputs(&paths, &[&args.bank])?;
    write_together(&args.output, files.iter().map(Ok), |(path, bytes)| {
        Ok(vec![begin_file(path, bytes, args.force)?])
    })?;
    let lines: String = paths.iter().map(|path| format!("{}\n", path.display())).collect();
    print(&lines)
}

pub(super) fn is_svg(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("svg"))
}

/// Refuses the name of a picture that promises another format than SVG.
pub(super) fn check_picture(path: &Path) -> Result<(), Failure> {
    if path.extension().is_none() || is_svg(path) {
        return Ok(());
    }
    let (name, svg) = (Quoted(path), Quoted(path.with_extension("svg")));
    Err(Failure::Usage(format!("{name}: pictures are written as SVG; name it {svg}")))
}

/// Writes a picture as SVG.
pub(super) fn write_picture(path: &Path, chart: &Chart, force: bool) -> Result<(), Failure> {
    write_bytes(path, chart.to_svg().in_file(path)?.as_bytes(), force)
}
