//! Who imports whom: fails on a circle of files and on an arrow that ARCHITECTURE.md does not allow.
//!
//! `cargo run -p arrows`. Imports are `use` lines and paths in the code, followed to the file that holds
//! what they name. Tests may import anything.

mod checks;
mod imports;

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let faults = checks::faults(&root).unwrap_or_else(|error| vec![format!("arrows: {error}")]);
    faults.iter().for_each(|fault| eprintln!("{fault}"));
    ExitCode::from(u8::from(!faults.is_empty()))
}
