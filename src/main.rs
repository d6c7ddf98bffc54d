//! The `hybank` binary: parse, run, report.

use std::process::ExitCode;

ctor::declarative::ctor! {
    // It reads the state of two descriptors, which needs nothing that `main` prepares.
    #[ctor(unsafe)]
    fn before_main() {
        hybank::files::note_closed_streams();
    }
}

fn main() -> ExitCode {
    hybank::cli::run()
}
