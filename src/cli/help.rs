//! `hybank help`: the help of a command, or the reference of spec files.

use super::{Cli, Failure};
use clap::CommandFactory;

/// The reference of spec files.
const SPEC: &str = include_str!("../../docs/spec.md");

/// Shows the help of a command, or the reference of spec files
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank help spec
  hybank help design")]
pub(super) struct Args {
    /// `spec` for the reference of spec files, or a command
    topic: Option<String>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure::Usage`] for a topic that does not exist.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let mut program = Cli::command();
    program.build();
    match args.topic.as_deref() {
        None => super::print(&program.render_long_help().to_string()),
        Some("spec") => super::print(SPEC),
        Some(name) => match program.find_subcommand_mut(name) {
            Some(command) => super::print(&command.render_long_help().to_string()),
            None => Err(Failure::Usage(unknown(name))),
        },
    }
}

fn unknown(name: &str) -> String {
    let program = Cli::command();
    let commands: Vec<&str> = program.get_subcommands().map(|command| command.get_name()).collect();
    format!("there is no help on \"{name}\"; the topics are spec, {}", commands.join(", "))
}
