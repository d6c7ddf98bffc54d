//! The command line: one file per command; the only place that prints.

// Printing macros panic where their output cannot be written.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod analyze;
mod bank_file;
mod before_after;
mod bit_true;
mod calibrate;
mod capture_args;
mod capture_check;
mod capture_file;
mod completions;
mod demo;
mod design;
mod event;
mod export;
mod failure;
mod file_kind;
mod folder;
mod fuse;
mod fused;
mod gaps;
mod help;
mod import;
mod init;
mod interrupt;
mod man;
mod match_bank;
mod measure;
mod measured;
mod observer;
mod output;
mod picture_format;
mod plot;
mod print;
mod recordings;
mod report;
mod run;
mod say;
mod schema;
mod simulate;
mod stream;
mod sweeps;
mod track;
mod turns;
mod verify;

use clap::{Parser, Subcommand};
pub use failure::Failure;
use print::{print, print_json};
use say::{say, warn};
use std::process::ExitCode;

/// Lets several slow, imperfectly timed converters do the work of one fast converter
///
/// hybank designs the digital filters that fuse slow captures into one fast signal with the least worst-case
/// error. It proves how good these filters are, and it runs them.
#[derive(Debug, Parser)]
#[command(
    name = "hybank",
    version,
    disable_help_subcommand = true,
    after_help = "\
Examples:
  hybank demo
  hybank init -o spec.toml
  hybank help spec
  hybank design spec.toml -o bank.json
  hybank verify bank.json
  hybank simulate bank.json --source chirp:50Hz..8kHz@1s -o captures
  hybank fuse bank.json captures/ch1.wav captures/ch2.wav -o fused.wav
  hybank measure fused.wav --ref captures/target.wav

Exit codes: 0 done; 1 the input or the design failed; 2 wrong usage."
)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Init(init::Args),
    Design(design::Args),
    Analyze(analyze::Args),
    Verify(verify::Args),
    Plot(plot::Args),
    Report(report::Args),
    Import(import::Args),
    Export(export::Args),
    Simulate(simulate::Args),
    Calibrate(calibrate::Args),
    Fuse(fuse::Args),
    Measure(measure::Args),
    Stream(stream::Args),
    Demo(demo::Args),
    Completions(completions::Args),
    Man(man::Args),
    Schema(schema::Args),
    Help(help::Args),
}

/// Runs the command that was typed; the exit code is 0 (done), 1 (the input or the design failed) or
/// 2 (wrong usage).
pub fn run() -> ExitCode {
    match Cli::try_parse() {
        Ok(cli) => match dispatch(cli.command) {
            Ok(()) => ExitCode::SUCCESS,
            Err(failure) => failure.report(),
        },
        Err(message) => show(&message),
    }
}

/// Shows help, version, or what is wrong with the usage.
fn show(message: &clap::Error) -> ExitCode {
    match message.print() {
        Err(error) if !message.use_stderr() => print::print_failure(&error).report(),
        _ => ExitCode::from(u8::try_from(message.exit_code()).unwrap_or(2)),
    }
}

fn dispatch(command: Command) -> Result<(), Failure> {
    match command {
        Command::Init(args) => init::run(&args),
        Command::Design(args) => design::run(&args),
        Command::Analyze(args) => analyze::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Plot(args) => plot::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Fuse(args) => fuse::run(&args),
        Command::Measure(args) => measure::run(&args),
        Command::Stream(args) => stream::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Completions(args) => completions::run(&args),
        Command::Man(args) => man::run(&args),
        Command::Schema(args) => schema::run(&args),
        Command::Help(args) => help::run(&args),
    }
}
