//! Prints messages to standard error.

use crate::files::leftovers;
use crate::overview::understood;
use crate::spec::Spec;
use std::io::{IsTerminal, Write};
use std::path::Path;

/// Prints text to standard error. Errors are ignored, so that no result is lost.
pub(super) fn say(text: &str) {
    let _ = crate::io::stderr().write_all(text.as_bytes());
}

/// A line on standard error with the program's name before it.
pub(super) fn say_line(line: &str) {
    say(&format!("hybank: {line}\n"));
}

/// A warning on standard error.
pub(super) fn warn(warning: &str) {
    say_line(&format!("warning: {warning}"));
}

/// What was understood from a spec, where a person reads it.
pub(super) fn say_understood(spec: Option<&Spec>) {
    if std::io::stderr().is_terminal() {
        spec.iter().for_each(|spec| say(&format!("{}\n", understood(spec))));
    }
}

/// Names the unfinished files that killed runs left beside `outputs`.
pub(super) fn name_leftovers(outputs: &[&Path]) {
    leftovers(outputs).iter().for_each(|left| warn(&left.to_string()));
}
