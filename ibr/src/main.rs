//! The `hybank-ibr` binary.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    hybank_ibr::cli::run()
}
