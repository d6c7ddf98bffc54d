//! Prints results to standard output.

use super::Failure;
use std::io::{ErrorKind, Write};

/// Results on standard output; a closed pipe ends the run without a message.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    print_bytes(text.as_bytes())
}

/// As [`print`], for any bytes.
pub(super) fn print_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut stdout = crate::io::stdout();
    stdout.write_all(bytes).and_then(|()| stdout.flush()).map_err(|error| print_failure(&error))
}

/// One JSON object on standard output.
pub(super) fn print_json(report: &impl serde::Serialize) -> Result<(), Failure> {
    print(&(serde_json::to_string(report).map_err(Failure::input)? + "\n"))
}

/// Why standard output could not be written.
pub(super) fn print_failure(error: &std::io::Error) -> Failure {
    match error.kind() {
        ErrorKind::BrokenPipe => Failure::ClosedPipe,
        _ => Failure::Input(format!("standard output: cannot write it: {error}")),
    }
}
