//! Failure of a command: one message on stderr and an exit code.

use hybank::files::unprinted;
use hybank::messages::{Quoted, printable, shown};
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;

/// A failure with the one message that the user sees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Failure {
    /// The input failed: exit code 1.
    Input(String),
    /// Wrong usage: exit code 2.
    Usage(String),
    /// The reader of our output went away: end without a word.
    ClosedPipe,
}

impl Failure {
    /// A failure of the input, from any error.
    pub(super) fn input(message: impl ToString) -> Self {
        Self::Input(message.to_string())
    }

    /// The same failure, said of a file.
    pub(super) fn in_file(self, path: &Path) -> Self {
        match self {
            Self::Input(message) => Self::Input(format!("{}: {message}", Quoted(path))),
            other => other,
        }
    }

    /// The same failure, said of a virtual view, from 0, of several.
    pub(super) fn of_view(self, view: usize, all: usize) -> Self {
        match self {
            Self::Input(message) if all > 1 => {
                Self::Input(format!("virtual view {} of {all}: {message}", view + 1))
            }
            other => other,
        }
    }

    /// A failure to print.
    pub(super) fn printing(error: &std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::BrokenPipe => Self::ClosedPipe,
            _ => Self::Input(unprinted(error)),
        }
    }

    /// Prints the message and gives the exit code.
    pub(super) fn report(&self) -> ExitCode {
        let (message, code) = match self {
            Self::Input(message) => (message, 1),
            Self::Usage(message) => (message, 2),
            Self::ClosedPipe => return ExitCode::SUCCESS,
        };
        say_line(message);
        ExitCode::from(code)
    }
}

/// Writes text of several lines to standard error.
pub(super) fn say(text: &str) {
    put(&printable(text));
}

/// A line on standard error with the program's name before it, in place of a progress bar that a terminal
/// shows there.
pub(super) fn say_line(line: &str) {
    let clear = if std::io::stderr().is_terminal() { "\r\x1b[2K" } else { "" };
    put(&format!("{clear}hybank-ibr: {}\n", shown(line)));
}

/// Every word on standard error comes this way, and nothing foreign is left in it. What cannot be written is
/// no reason to lose a result.
fn put(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}
