//! Standard streams that were closed when the program began (`>&-`). The standard library puts /dev/null in
//! their place before `main`, which takes all that is written and has nothing to read.

use super::atomic::committed;
use crate::messages::{Quoted, counted};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};

/// A standard stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StandardStream {
    /// Standard input.
    Input,
    /// Standard output.
    Output,
}

static IS_INPUT_CLOSED: AtomicBool = AtomicBool::new(false);
static IS_OUTPUT_CLOSED: AtomicBool = AtomicBool::new(false);

/// Notes which standard streams are closed. A program calls it before its `main`; later all are open.
///
/// ```
/// use hybank::files::{StandardStream, note_closed_streams, unprinted};
/// note_closed_streams();
/// // This is an error in a program that was started with `>&-`.
/// assert!(StandardStream::Output.check().map_err(|error| unprinted(&error)).is_ok());
/// ```
pub fn note_closed_streams() {
    #[cfg(unix)]
    {
        use std::os::fd::AsFd;
        let is_closed = |copy: io::Result<_>| copy.is_err_and(|error: io::Error| is_no_descriptor(&error));
        let (input, output) = (io::stdin(), io::stdout());
        IS_INPUT_CLOSED.store(is_closed(input.as_fd().try_clone_to_owned()), Ordering::Relaxed);
        IS_OUTPUT_CLOSED.store(is_closed(output.as_fd().try_clone_to_owned()), Ordering::Relaxed);
    }
}

#[cfg(unix)]
fn is_no_descriptor(error: &io::Error) -> bool {
    error.raw_os_error() == Some(nix::errno::Errno::EBADF as i32)
}

impl StandardStream {
    /// Refuses to use the stream if it was closed when the program began.
    ///
    /// # Errors
    /// The reason, for a message that names the stream.
    pub fn check(self) -> io::Result<()> {
        let is_closed = match self {
            Self::Input => &IS_INPUT_CLOSED,
            Self::Output => &IS_OUTPUT_CLOSED,
        };
        match is_closed.load(Ordering::Relaxed) {
            true => {
                Err(io::Error::other("it is closed; leave it open, or redirect it to a file or /dev/null"))
            }
            false => Ok(()),
        }
    }
}

/// The message for standard output that cannot be written. It names what this process has written to files
/// all the same.
pub fn unprinted(error: &io::Error) -> String {
    let written = match &committed()[..] {
        [] => String::new(),
        [one] => format!("; {} is written", Quoted(one)),
        [first, others @ ..] => {
            format!("; {} and {} are written", Quoted(first), counted(others.len(), "other file"))
        }
    };
    format!("standard output: cannot write it: {error}{written}")
}
