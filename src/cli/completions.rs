//! `hybank completions`: shell completions from the same definition as the parser.

use super::{Cli, Failure};
use clap::CommandFactory;
use clap_complete::Shell;

/// Prints completions for a shell
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank completions bash > ~/.local/share/bash-completion/completions/hybank
  hybank completions fish > ~/.config/fish/completions/hybank.fish")]
pub(super) struct Args {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Runs the command.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "hybank", &mut script);
    super::print(&String::from_utf8_lossy(&script))
}
