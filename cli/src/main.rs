//! The program `hybank`: one file per command; the only place that prints.
// Printing macros panic where their output cannot be written.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod align;
mod analyze;
mod bank_file;
mod before_after;
mod bit_true;
mod calibrate;
mod calibrate_report;
mod capture_args;
mod capture_check;
mod capture_file;
mod choice;
mod contenders;
mod demo;
mod design;
mod design_report;
mod design_studies;
mod design_watch;
mod event_file;
mod export;
mod file_kind;
mod fuse;
mod gaps;
mod import;
mod interrupt;
mod measure;
mod merge;
mod observer;
mod output;
mod plot;
mod print;
mod proof_search;
mod report;
mod run;
mod simulate;
mod stream;
mod table_args;
mod texts;
mod tracked;
mod verify;
mod virtual_converters;
mod virtual_signal;
mod written;

use clap::{Parser, Subcommand};
use hybank_program::arguments;
use hybank_program::interrupts;
use print::{Failure, PROGRAM};
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
  hybank merge left.wav right.wav -o merged.wav
  hybank init -o spec.toml
  hybank help spec
  hybank design spec.toml -o bank.json
  hybank verify bank.json
  hybank simulate bank.json --source chirp:50Hz..8kHz@1s -o captures
  hybank fuse bank.json captures/ch1.wav captures/ch2.wav -o fused.wav
  hybank measure fused.wav --ref captures/target.wav

Exit codes: 0 done; 1 the input or the design failed; 2 wrong usage."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Init(texts::InitArgs),
    Design(design::Args),
    Analyze(analyze::Args),
    Verify(verify::Args),
    Plot(plot::Args),
    Report(report::Args),
    Import(import::Args),
    Export(export::Args),
    Simulate(simulate::Args),
    Calibrate(calibrate::Args),
    Align(align::Args),
    Merge(merge::Args),
    Fuse(fuse::Args),
    Measure(measure::Args),
    Stream(stream::Args),
    Demo(demo::Args),
    Completions(texts::CompletionsArgs),
    Man(texts::ManArgs),
    Schema(texts::SchemaArgs),
    Help(texts::HelpArgs),
}

/// Runs the command that was typed; the exit code is 0 (done), 1 (the input or the design failed) or
/// 2 (wrong usage).
fn main() -> ExitCode {
    interrupts::handle();
    match arguments::<Cli>() {
        Ok(cli) => PROGRAM.end(dispatch(cli.command)),
        Err(message) => PROGRAM.show(&message),
    }
}

fn dispatch(command: Command) -> Result<(), Failure> {
    match command {
        Command::Init(args) => texts::init(&args),
        Command::Design(args) => design::run(&args),
        Command::Analyze(args) => analyze::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Plot(args) => plot::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Import(args) => import::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Align(args) => align::run(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Fuse(args) => fuse::run(&args),
        Command::Measure(args) => measure::run(&args),
        Command::Stream(args) => stream::run(&args),
        Command::Demo(args) => demo::run(&args),
        Command::Completions(args) => texts::completions(&args),
        Command::Man(args) => texts::man(&args),
        Command::Schema(args) => texts::schema(&args),
        Command::Help(args) => texts::help(&args),
    }
}
