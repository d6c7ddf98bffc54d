//! How a command fails: one message on stderr and an exit code.

use super::say::say_line;
use crate::pipeline::PipelineError;
use std::process::ExitCode;

/// A failure with the one message that the user sees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// The input or the design failed: exit code 1.
    Input(String),
    /// Wrong usage: exit code 2.
    Usage(String),
    /// The reader of the output closed the pipe: end without a message.
    ClosedPipe,
}

impl Failure {
    /// A failure of the input with `message`.
    pub fn input(message: impl ToString) -> Self {
        Self::Input(message.to_string())
    }

    /// A failure of a run. A closed output pipe is not reported as an error.
    pub(super) fn running(error: impl Into<PipelineError>) -> Self {
        match error.into() {
            error if error.is_closed_pipe() => Self::ClosedPipe,
            error => Self::input(error),
        }
    }

    /// Prints the message and gives the exit code.
    pub fn report(&self) -> ExitCode {
        match self {
            Self::Input(message) => {
                say_line(message);
                ExitCode::from(1)
            }
            Self::Usage(message) => {
                say_line(message);
                ExitCode::from(2)
            }
            Self::ClosedPipe => ExitCode::SUCCESS,
        }
    }
}
