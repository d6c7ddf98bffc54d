//! The command line of `hybank-ibr`, and the only module that prints.

mod arguments;
mod bound;
mod contact;
mod demo;
mod failure;
mod heat;
mod inputs;
mod memory;
mod output;
mod progress;
mod render;
mod source;
mod summary;

use arguments::{Arguments, Command};
use clap::Parser;
use failure::Failure;
use std::process::ExitCode;

/// More threads than cores would only use memory for stacks.
const MOST_THREADS: usize = 1024;

/// Reads the arguments, runs the command and maps its outcome to an exit code: 0 success, 1 input error, 2
/// usage error.
pub fn run() -> ExitCode {
    #[cfg(unix)]
    hybank::files::fail_at_file_size_limit();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(message) => return show(&message),
    };
    let outcome = match arguments.command {
        Command::Render(arguments) => in_pool(arguments.scene.threads, || render::run(&arguments)),
        Command::Bound(arguments) => in_pool(arguments.scene.threads, || bound::run(&arguments)),
        Command::Demo(arguments) => in_pool(arguments.threads, || demo::run(&arguments)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// Shows help, version or what is wrong with the usage.
fn show(message: &clap::Error) -> ExitCode {
    match message.print() {
        Err(error) if !message.use_stderr() => Failure::printing(&error).report(),
        _ => ExitCode::from(u8::try_from(message.exit_code()).unwrap_or(2)),
    }
}

/// Runs the work on the given number of threads, by default on all cores; on this thread if none can be
/// started.
fn in_pool(threads: Option<usize>, work: impl FnOnce() -> Result<(), Failure> + Send) -> Result<(), Failure> {
    let Some(threads) = threads else {
        let builder = || rayon::ThreadPoolBuilder::new();
        let pool = builder().build().or_else(|_| builder().num_threads(1).use_current_thread().build());
        return pool.map_err(Failure::input)?.install(work);
    };
    if !(1..=MOST_THREADS).contains(&threads) {
        return Err(Failure::Usage(format!("--threads {threads}: it must be 1 to {MOST_THREADS}")));
    }
    let refused = |error| Failure::Input(format!("--threads {threads}: {error}; ask for fewer"));
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(refused)?.install(work)
}
