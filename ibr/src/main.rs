//! The `hybank-ibr` binary.

use std::process::ExitCode;

fn main() -> ExitCode {
    hybank_ibr::cli::run()
}
