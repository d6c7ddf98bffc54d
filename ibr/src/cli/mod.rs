//! The command line of `hybank-ibr`, and the only module that prints.

mod arguments;
mod bound;
mod evaluate;
mod failure;
mod init;
mod inputs;
mod output;
mod render;
mod source;
mod summary;

use arguments::{Arguments, Command};
use failure::{Failure, PROGRAM, usage};
use hybank_program::interrupts;
use std::process::ExitCode;

/// More threads than cores would only use memory for stacks.
const MOST_THREADS: usize = 1024;

/// Reads the arguments, runs the command and maps its outcome to an exit code: 0 success, 1 input error, 2
/// usage error.
pub fn run() -> ExitCode {
    interrupts::handle();
    let arguments = match hybank_program::arguments::<Arguments>() {
        Ok(arguments) => arguments,
        Err(message) => return PROGRAM.show(&message),
    };
    let outcome = match arguments.command {
        Command::Render(arguments) => in_pool(arguments.scene.threads, || render::run(&arguments)),
        Command::Bound(arguments) => in_pool(arguments.scene.threads, || bound::run(&arguments)),
        Command::Evaluate(arguments) => in_pool(arguments.scene.threads, || evaluate::run(&arguments)),
        Command::Init(arguments) => in_pool(arguments.threads, || init::run(&arguments)),
    };
    PROGRAM.end(outcome)
}

/// Runs the work on the given number of threads, by default on all cores.
fn in_pool(threads: Option<usize>, work: impl FnOnce() -> Result<(), Failure> + Send) -> Result<(), Failure> {
    let count = threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    if !(1..=MOST_THREADS).contains(&count) {
        return usage(format!("--threads {count}: it must be 1 to {MOST_THREADS}"));
    }
    let refused = |error| Failure::Input(format!("--threads {count}: {error}; ask for fewer"));
    rayon::ThreadPoolBuilder::new().num_threads(count).build().map_err(refused)?.install(work)
}
