//! The `hybank` binary: parse, run, report.

use std::process::ExitCode;

fn main() -> ExitCode {
    hybank::cli::run()
}
