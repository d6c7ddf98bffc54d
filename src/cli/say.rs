//! Standard error: everything that is no result.

use std::io::Write;

/// Text on standard error. One that cannot be written is no reason to lose a result.
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
