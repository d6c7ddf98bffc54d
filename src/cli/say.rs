//! Prints messages to standard error.

use std::io::Write;

/// Prints text to standard error. Errors are ignored, so that no result is lost.
pub(super) fn say(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// A line on standard error with the program's name before it.
pub(super) fn say_line(line: &str) {
    say(&format!("hybank: {line}\n"));
}

/// A warning on standard error.
pub(super) fn warn(warning: &str) {
    say_line(&format!("warning: {warning}"));
}
