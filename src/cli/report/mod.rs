//! `hybank report`: all that is known of a bank, on one page.

mod page;
mod recordings;

use super::Failure;
use super::bank_file::{is_dash, load, name, write_text};
use super::say::name_leftovers;
use crate::design::DesignError;
use crate::files::refuse_overlaps;
use crate::overview::{Facts, pictures};
use page::{Figure, Page};
use recordings::Spectra;
use std::path::{Path, PathBuf};

/// Writes a page (HTML) about a bank: what it is for, its error with the proven bounds, its filters, its
/// cost
///
/// The page is one file that loads nothing. With captures it also shows their spectra, plainly interleaved
/// and fused by the bank.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank report bank.json -o report.html
  hybank report bank.json ch1.wav ch2.wav -o report.html")]
pub(super) struct Args {
    /// The bank (JSON)
    bank: PathBuf,
    /// Captures to fuse, as `hybank fuse` takes them: one mono file per channel, or one of N channels
    inputs: Vec<PathBuf>,
    /// The page; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check()?;
    let bank = load(&args.bank)?;
    let named = |error: &dyn std::fmt::Display| Failure::Input(format!("{}: {error}", name(&args.bank)));
    let Some(spec) = &bank.spec else { return Err(named(&DesignError::NoSpec)) };
    let mut figures = Vec::new();
    for picture in pictures(&bank).map_err(|error| named(&error))? {
        figures.push(Figure::new(&picture.chart, picture.caption).map_err(|error| named(&error))?);
    }
    let spectra = match args.inputs.as_slice() {
        [] => None,
        inputs => Some(Spectra::read(&bank, &args.bank, inputs)?.figure()?),
    };
    let page = Page {
        facts: Facts::new(&bank, spec).map_err(|error| named(&error))?,
        figures,
        spectra,
        spec: spec.to_toml().map_err(|error| named(&error))?,
        commands: args.commands(),
    };
    write_text(&args.output, &page.html(), args.force)
}

impl Args {
    fn check(&self) -> Result<(), Failure> {
        if is_dash(&self.output) {
            return Ok(());
        }
        let inputs: Vec<&Path> = self.inputs.iter().chain([&self.bank]).map(PathBuf::as_path).collect();
        refuse_overlaps(&[&self.output], &inputs).map_err(Failure::input)?;
        name_leftovers(&[&self.output]);
        Ok(())
    }

    /// The command lines that lead to what the page shows.
    fn commands(&self) -> Vec<String> {
        let bank = self.bank.display();
        let inputs: String = self.inputs.iter().map(|path| format!(" {}", path.display())).collect();
        let mut commands = vec![
            "hybank design spec.toml -o bank.json  # the spec above, saved as spec.toml".to_owned(),
            format!("hybank verify {bank}"),
            format!("hybank analyze {bank} --sensitivity"),
            format!("hybank plot {bank} -o pictures"),
        ];
        if !self.inputs.is_empty() {
            commands.push(format!("hybank fuse {bank}{inputs} -o fused.wav"));
        }
        commands.push(format!("hybank report {bank}{inputs} -o {}", self.output.display()));
        commands
    }
}
