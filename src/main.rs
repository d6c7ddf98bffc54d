//! The `hybank` binary: parse, run, report.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    hybank::cli::run()
}
