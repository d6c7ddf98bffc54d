//! The command line: one file a verb; the only place that prints.

mod bank_file;
mod failure;
mod fuse;
mod output;

use clap::{Parser, Subcommand};
pub use failure::Failure;
use std::process::ExitCode;

/// What was typed.
#[derive(Debug, Parser)]
#[command(name = "hybank", version, about, long_about = None)]
pub struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Fuse(fuse::Args),
}

/// Runs the verb that was typed; the exit code is 0 (done), 1 (the input or the design failed) or
/// 2 (wrong usage).
pub fn run() -> ExitCode {
    match dispatch(Cli::parse().verb) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

fn dispatch(verb: Verb) -> Result<(), Failure> {
    match verb {
        Verb::Fuse(args) => fuse::run(args),
    }
}
