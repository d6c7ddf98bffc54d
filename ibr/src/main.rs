//! The `hybank-ibr` binary.

use std::process::ExitCode;

// Before `main`: the standard library then opens /dev/null in the place of a closed stream, and what a
// parent opened there by itself (Python's `subprocess.DEVNULL`, daemons) has the same flags, position and
// inode, so nothing tells the two apart later. The macro allows itself the unsafe code that this takes.
ctor::declarative::ctor! {
    #[ctor(unsafe)]
    fn before_main() {
        hybank::memory::share_heap();
        hybank::files::note_closed_streams();
    }
}

fn main() -> ExitCode {
    hybank_ibr::cli::run()
}
