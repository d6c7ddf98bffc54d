//! `hybank man`: manual pages from the same definition as the parser.

use super::bank_file::begin_file;
use super::folder::write_together;
use super::{Cli, Failure};
use clap::CommandFactory;
use clap_mangen::Man;
use std::path::PathBuf;

/// Writes the manual pages: hybank.1 and one per command
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank man ~/.local/share/man/man1
  man hybank-design")]
pub(super) struct Args {
    /// The folder; created if missing
    folder: PathBuf,
    /// Replace existing pages
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let mut program = Cli::command();
    // Gives the commands their full names.
    program.build();
    let commands = program.get_subcommands().cloned();
    let pages = std::iter::once(program.clone()).chain(commands).map(page);
    write_together(&args.folder, pages, |(name, text): (String, Vec<u8>)| {
        Ok(vec![begin_file(&args.folder.join(name), &text, args.force)?])
    })
}

/// The name of the file and its text.
fn page(command: clap::Command) -> Result<(String, Vec<u8>), Failure> {
    let mut text = Vec::new();
    let man = Man::new(command.version(env!("CARGO_PKG_VERSION")));
    man.render(&mut text).map_err(Failure::input)?;
    Ok((man.get_filename(), text))
}
