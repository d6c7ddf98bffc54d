//! The `hybank` binary: parse, run, report.

#![deny(unsafe_code)]

use std::process::ExitCode;

/// The state of two descriptors, read while closed ones can still be told from /dev/null. The macro writes
/// unsafe code; what runs needs nothing that `main` prepares.
#[allow(unsafe_code)]
mod before_main {
    ctor::declarative::ctor! {
        #[ctor(unsafe)]
        fn note_closed_streams() {
            hybank::files::note_closed_streams();
        }
    }
}

fn main() -> ExitCode {
    hybank::cli::run()
}
