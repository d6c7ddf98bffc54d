//! Failure of a command: one message on stderr and an exit code.

use std::io::Write;
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
    pub(super) fn in_file(self, path: &std::path::Path) -> Self {
        match self {
            Self::Input(message) => Self::Input(format!("{}: {message}", path.display())),
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
            _ => Self::Input(format!("standard output: {error}")),
        }
    }

    /// Prints the message and gives the exit code.
    pub(super) fn report(&self) -> ExitCode {
        match self {
            Self::Input(message) => {
                say(&format!("hybank-ibr: {message}\n"));
                ExitCode::from(1)
            }
            Self::Usage(message) => {
                say(&format!("hybank-ibr: {message}\n"));
                ExitCode::from(2)
            }
            Self::ClosedPipe => ExitCode::SUCCESS,
        }
    }
}

/// Writes text to standard error; one that cannot be written is no reason to lose a result.
pub(super) fn say(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}
