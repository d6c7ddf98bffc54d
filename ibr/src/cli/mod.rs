//! The command line of `hybank-ibr`, and the only module that prints.

mod arguments;
mod contact;
mod demo;
mod failure;
mod output;
mod progress;
mod render;
mod summary;

use arguments::{Arguments, Command};
use clap::Parser;
use failure::Failure;
use std::process::ExitCode;

/// More threads than cores would only use memory for stacks.
const MOST_THREADS: usize = 1024;

/// Reads the arguments, runs the command and maps its outcome to an exit code: 0 success, 1 input error, 2 usage
/// error.
pub fn run() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Render(arguments) => in_pool(arguments.threads, || render::run(&arguments)),
        Command::Demo(arguments) => in_pool(arguments.threads, || demo::run(&arguments)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// Runs the work on the given number of threads, by default on all cores.
fn in_pool(threads: Option<usize>, work: impl FnOnce() -> Result<(), Failure> + Send) -> Result<(), Failure> {
    let Some(threads) = threads else { return work() };
    if !(1..=MOST_THREADS).contains(&threads) {
        return Err(Failure::Usage(format!("--threads {threads}: it must be 1 to {MOST_THREADS}")));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(Failure::input)?;
    pool.install(work)
}
