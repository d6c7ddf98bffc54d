//! `hybank report`: all that is known of a bank, on one page.

use super::bank_file::load;
use super::capture_args::{CaptureArgs, InterleavedArgs, output_rate};
use super::capture_file::{start, unread};
use super::print::{Failure, failed, failed_at, is_dash, name, shell_word, stopped, warn};
use super::written::{check_output, write_text};
use hybank::bank::Bank;
use hybank::captures::{Captures, Converters};
use hybank::design::DesignError;
use hybank::io::check_real;
use hybank::messages::Quoted;
use hybank::overview::page::{CapturesOnPage, MOST_FRAMES, Page, PageError};
use hybank::units::Hertz;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Writes a page (HTML) about a bank: what it is for, its error with the proven bounds, its filters, its
/// cost
///
/// The page is one file that loads nothing. With captures it also shows their spectra, plainly interleaved
/// and fused by the bank, and of a tone the figures and the spurs before and after.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank report bank.json -o report.html
  hybank report bank.json ch1.wav ch2.wav -o report.html
  hybank report quad.json codes.csv --interleaved 4 --full-scale 8bits -o report.html")]
pub(super) struct Args {
    /// The bank (JSON)
    bank: PathBuf,
    /// Captures to fuse, as `hybank fuse` takes them: one mono file per channel, or one of N channels
    inputs: Vec<PathBuf>,
    /// The page; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    reading: CaptureArgs,
    #[command(flatten)]
    interleaved: InterleavedArgs,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.reading.check(args.interleaved.is_given())?;
    args.interleaved.check(args.inputs.len())?;
    let inputs: Vec<&Path> = args.inputs.iter().chain([&args.bank]).map(PathBuf::as_path).collect();
    check_output(&args.output, &inputs, args.force)?;
    let is_page = |ending: &OsStr| ["html", "htm"].iter().any(|page| ending.eq_ignore_ascii_case(page));
    if !is_dash(&args.output) && !args.output.extension().is_none_or(is_page) {
        let message = "a report is a page; give it a name that ends in .html, and print that for a PDF";
        return Err(Failure::Usage(format!("{}: {message}", Quoted(&args.output))));
    }
    let bank = load(&args.bank)?;
    if bank.spec.is_none() {
        return Err(failed_at(&args.bank, DesignError::NoSpec));
    }
    let captures = if args.inputs.is_empty() { None } else { Some(args.captures(&bank)?) };
    let page = Page::new(&bank, captures).map_err(|error| of_page(&args.bank, error))?;
    write_text(&args.output, &page.html(&args.commands()), args.force)
}

/// A failure of the bank in the file `path`.
fn of_page(path: &Path, error: PageError) -> Failure {
    match error {
        PageError::Design(error) => failed_at(path, error),
        PageError::Fuse(error) => stopped(error),
        error => failed_at(path, error),
    }
}

impl Args {
    /// The command lines that lead to what the page shows, the last one as it was typed.
    fn commands(&self) -> Vec<String> {
        let typed: Vec<String> =
            std::env::args_os().skip(1).map(|word| shell_word(&word.to_string_lossy())).collect();
        vec![
            "hybank design spec.toml -o bank.json  # the spec above, saved as spec.toml".to_owned(),
            format!("hybank verify {}", shell_word(&self.bank.display().to_string())),
            format!("hybank {}", typed.join(" ")),
        ]
    }

    /// The captures, fused by `bank`.
    fn captures(&self, bank: &Bank) -> Result<CapturesOnPage, Failure> {
        let converters = Converters::from(bank);
        let interleaving = self.interleaved.interleaving(&converters, &self.bank)?;
        let options = converters.options(self.reading.format(), self.inputs.len(), interleaving.as_ref());
        let mut reader = start(&self.inputs, options)?;
        let rate = Hertz(output_rate(bank, &self.bank, &reader)?);
        check_real(&reader).map_err(failed)?;
        let captures = Captures::read(&mut reader, MOST_FRAMES).map_err(unread)?;
        let is_cut = captures.is_cut;
        let channels: Vec<_> = captures.channels.into_iter().map(|channel| channel.samples).collect();
        reader.warnings().iter().for_each(|warning| warn(&warning.to_string()));
        let names = self.inputs.iter().map(|input| name(input)).collect::<Vec<_>>().join(", ");
        let frames = channels.iter().map(Vec::len).min().unwrap_or(0);
        if is_cut {
            warn(&format!("{names}: only the first {frames} frames are on the page"));
        }
        CapturesOnPage::new(bank, rate, channels, is_cut).map_err(|error| match error {
            PageError::Short { .. } => Failure::Input(format!("{names}: {error}")),
            error => of_page(&self.bank, error),
        })
    }
}
