//! The command line of `hybank-ibr`, and the only module that prints.

mod arguments;
mod bound;
mod demo;
mod failure;
mod heat;
mod init;
mod inputs;
mod output;
mod place;
mod progress;
mod render;
mod source;
mod summary;

use arguments::{Arguments, Command};
use failure::{Failure, PROGRAM, failed, usage};
use hybank::memory::{affordable_threads, check_memory};
use std::process::ExitCode;

/// More threads than cores would only use memory for stacks.
const MOST_THREADS: usize = 1024;

/// Bytes of memory that every command takes beside what it counts.
const LEAST_MEMORY: f64 = 24e6;

/// Reads the arguments, runs the command and maps its outcome to an exit code: 0 success, 1 input error, 2
/// usage error.
pub fn run() -> ExitCode {
    #[cfg(unix)]
    hybank::files::fail_at_file_size_limit();
    let arguments = match hybank::messages::arguments::<Arguments>() {
        Ok(arguments) => arguments,
        Err(message) => return PROGRAM.show(&message),
    };
    let outcome = match arguments.command {
        Command::Render(arguments) => in_pool(arguments.scene.threads, || render::run(&arguments)),
        Command::Bound(arguments) => in_pool(arguments.scene.threads, || bound::run(&arguments)),
        Command::Place(arguments) => in_pool(arguments.scene.threads, || place::run(&arguments)),
        Command::Init(arguments) => in_pool(arguments.threads, || init::run(&arguments)),
        Command::Demo(arguments) => in_pool(arguments.threads, || demo::run(&arguments)),
    };
    PROGRAM.end(outcome)
}

/// Runs the work on the given number of threads, by default on all cores; on fewer where addresses are
/// limited, and on this thread if that leaves one or none can be started.
fn in_pool(threads: Option<usize>, work: impl FnOnce() -> Result<(), Failure> + Send) -> Result<(), Failure> {
    if threads.is_some_and(|threads| !(1..=MOST_THREADS).contains(&threads)) {
        let threads = threads.unwrap_or_default();
        return usage(format!("--threads {threads}: it must be 1 to {MOST_THREADS}"));
    }
    let builder = rayon::ThreadPoolBuilder::new;
    let alone = || builder().num_threads(1).use_current_thread().build().map_err(failed);
    let several = |count| builder().num_threads(count).build();
    let pool = match (affordable_threads(threads), threads) {
        (1, _) => alone(),
        (count, Some(threads)) => several(count)
            .map_err(|error| Failure::Input(format!("--threads {threads}: {error}; ask for fewer"))),
        (count, None) => several(count).or_else(|_| alone()),
    }?;
    // With the stacks of the threads, which are in use now. An allocation of text or a small table that
    // fails would end the process.
    let refused = |shortage| format!("every command takes {shortage}; allow more, or use --threads 1");
    check_memory(LEAST_MEMORY).map_err(|shortage| failed(refused(shortage)))?;
    pool.install(work)
}
