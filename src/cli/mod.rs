//! The command line: one file a verb; the only place that prints.

mod analyze;
mod bank_file;
mod completions;
mod demo;
mod design;
mod failure;
mod fuse;
mod fusing;
mod gaps;
mod interrupt;
mod match_bank;
mod output;
mod recordings;
mod simulate;
mod stream;
mod verify;

use clap::{Parser, Subcommand};
pub use failure::Failure;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// Several slow, imperfectly timed converters doing the work of one fast one
///
/// hybank designs the digital synthesis filters that fuse slow captures into one fast signal with the
/// least worst-case error, proves how good they are, and runs them.
#[derive(Debug, Parser)]
#[command(
    name = "hybank",
    version,
    after_help = "\
Examples:
  hybank demo
  hybank design spec.toml -o bank.json
  hybank verify bank.json
  hybank simulate bank.json --source chirp:50Hz..8kHz@1s -o captures
  hybank fuse bank.json captures/ch1.wav captures/ch2.wav -o fused.wav

Exit codes: 0 done; 1 the input or the design failed; 2 wrong usage."
)]
pub struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Design(design::Args),
    Analyze(analyze::Args),
    Verify(verify::Args),
    Simulate(simulate::Args),
    Fuse(fuse::Args),
    Stream(stream::Args),
    Demo(demo::Args),
    Completions(completions::Args),
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
        Verb::Design(args) => design::run(&args),
        Verb::Analyze(args) => analyze::run(&args),
        Verb::Verify(args) => verify::run(&args),
        Verb::Simulate(args) => simulate::run(&args),
        Verb::Fuse(args) => fuse::run(args),
        Verb::Stream(args) => stream::run(&args),
        Verb::Demo(args) => demo::run(&args),
        Verb::Completions(args) => completions::run(&args),
    }
}

/// Results on standard output; a reader that went away ends the run quietly.
fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Err(Failure::ClosedPipe),
        Err(error) => Err(Failure::Input(format!("standard output: cannot write it: {error}"))),
    }
}

/// One JSON object on standard output.
fn print_json(report: &impl serde::Serialize) -> Result<(), Failure> {
    print(&(serde_json::to_string(report).map_err(Failure::input)? + "\n"))
}
