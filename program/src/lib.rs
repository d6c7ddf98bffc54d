//! What every program here says, and how it ends: results on standard output, messages on standard error,
//! and the one message of a failure.
//!
//! ```
//! use hybank_program::{Failure, Program, print};
//! use std::process::ExitCode;
//! const PROGRAM: Program = Program { name: "resample", has_bar: false };
//! let run = |rate: u32| match rate {
//!     0 => Err(Failure::Usage("--rate 0: it must be positive".into())),
//!     rate => print(&format!("{rate} Hz\n")),
//! };
//! assert_eq!((PROGRAM.end(run(48_000)), PROGRAM.end(run(0))), (ExitCode::SUCCESS, ExitCode::from(2)));
//! ```

mod arguments;
pub mod interrupts;

pub use arguments::arguments;

use hybank_core::messages::{Quoted, printable, shown};
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::process::ExitCode;

/// A failure with the one message that the user sees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// The input or the work failed: exit code 1.
    Input(String),
    /// Wrong usage: exit code 2.
    Usage(String),
    /// The reader of the output closed the pipe: end without a message.
    ClosedPipe,
}

impl Failure {
    /// Why standard output could not be written.
    pub fn printing(error: &io::Error) -> Self {
        match error.kind() {
            ErrorKind::BrokenPipe => Self::ClosedPipe,
            _ => Self::Input(format!("standard output: cannot write it: {error}")),
        }
    }

    /// The same failure of the input, said of a file.
    pub fn in_file(self, path: &Path) -> Self {
        match self {
            Self::Input(message) => Self::Input(format!("{}: {message}", Quoted(path))),
            other => other,
        }
    }
}

/// A program in its messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Program {
    /// What stands before each line.
    pub name: &'static str,
    /// Whether a terminal shows a progress bar on standard error, in whose place a line goes.
    pub has_bar: bool,
}

impl Program {
    /// A line on standard error with the name of the program before it.
    pub fn say_line(&self, line: &str) {
        let clear = if self.has_bar && io::stderr().is_terminal() { "\r\x1b[2K" } else { "" };
        put(&format!("{clear}{}: {}\n", self.name, shown(line)));
    }

    /// A warning on standard error.
    pub fn warn(&self, warning: &str) {
        self.say_line(&format!("warning: {warning}"));
    }

    /// The exit code, after the message of a failure.
    pub fn end(&self, outcome: Result<(), Failure>) -> ExitCode {
        outcome.map_or_else(|failure| self.fail(failure).into(), |()| ExitCode::SUCCESS)
    }

    /// Says why the program fails; its exit code.
    pub fn fail(&self, failure: Failure) -> u8 {
        let (message, code) = match failure {
            Failure::ClosedPipe => return 0,
            Failure::Input(message) => (message, 1),
            Failure::Usage(message) => (message, 2),
        };
        self.say_line(&message);
        code
    }

    /// Shows help, the version or what is wrong with the usage; the exit code.
    pub fn show(&self, message: &clap::Error) -> ExitCode {
        if message.use_stderr() {
            say(&arguments::quoted_usage(message));
        } else if let Err(failure) = print(&message.to_string()) {
            return self.end(Err(failure));
        }
        ExitCode::from(u8::try_from(message.exit_code()).unwrap_or(2))
    }
}

/// Results on standard output.
///
/// # Errors
/// [`Failure::printing`].
pub fn print(text: &str) -> Result<(), Failure> {
    print_bytes(text.as_bytes())
}

/// As [`print()`], for any bytes.
///
/// # Errors
/// [`Failure::printing`].
pub fn print_bytes(bytes: &[u8]) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    let written = stdout.write_all(bytes);
    written.and_then(|()| stdout.flush()).map_err(|error| Failure::printing(&error))
}

/// Text of several lines on standard error.
pub fn say(text: &str) {
    put(&printable(text));
}

/// Every word on standard error comes this way, and nothing foreign is left in it. What cannot be written is
/// no reason to lose a result.
pub fn put(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

/// Whether a path stands for standard input or output.
pub fn is_dash(path: &Path) -> bool {
    path.as_os_str() == "-"
}
