//! This program in its messages, and its failures.

pub(super) use hybank_program::Failure;
use hybank_program::Program;

pub(super) const PROGRAM: Program = Program { name: "hybank-ibr", has_bar: true };

/// A failure of the input, from any error.
pub(super) fn failed(message: impl ToString) -> Failure {
    Failure::Input(message.to_string())
}

/// That the program was not used as it can be.
pub(super) fn usage<T>(message: impl Into<String>) -> Result<T, Failure> {
    Err(Failure::Usage(message.into()))
}

/// The same failure, said of a virtual view, from 0, of several.
pub(super) fn of_view(failure: Failure, view: usize, all: usize) -> Failure {
    match failure {
        Failure::Input(message) if all > 1 => {
            failed(format!("virtual view {} of {all}: {message}", view + 1))
        }
        other => other,
    }
}

impl From<crate::files::InputError> for Failure {
    fn from(error: crate::files::InputError) -> Self {
        failed(error)
    }
}
