//! Who imports whom: fails on a circle of files and on an arrow that ARCHITECTURE.md does not allow.
//!
//! `cargo run -p arrows`; `cargo run -p arrows -- --list` prints the arrows between rooms with a file that draws each.
//! Imports are `use` lines and paths in the code, followed to the file that holds what they name. Tests may import anything.

mod checks;
mod circles;
mod file;
mod house;
mod rules;
mod tokens;

use checks::Survey;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let survey = match Survey::new(&root) {
        Ok(survey) => survey,
        Err(error) => {
            eprintln!("arrows: {error}");
            return ExitCode::FAILURE;
        }
    };
    if std::env::args().any(|word| word == "--list") {
        survey.list().iter().for_each(|line| println!("{line}"));
    }
    let faults = survey.faults();
    faults.iter().for_each(|fault| eprintln!("{fault}"));
    ExitCode::from(u8::from(!faults.is_empty()))
}
