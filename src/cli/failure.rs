//! How a verb fails: one message on stderr and an exit code.

use std::process::ExitCode;

/// A failure with the one message that the user sees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// The input or the design failed: exit code 1.
    Input(String),
    /// Wrong usage: exit code 2.
    Usage(String),
    /// The reader of our output went away: end without a word.
    ClosedPipe,
}

impl Failure {
    /// A failure of the input, from anything that can say what is wrong.
    pub fn input(message: impl ToString) -> Self {
        Self::Input(message.to_string())
    }

    /// Prints the message and gives the exit code.
    pub fn report(&self) -> ExitCode {
        match self {
            Self::Input(message) => {
                eprintln!("hybank: {message}");
                ExitCode::from(1)
            }
            Self::Usage(message) => {
                eprintln!("hybank: {message}");
                ExitCode::from(2)
            }
            Self::ClosedPipe => ExitCode::SUCCESS,
        }
    }
}
