//! Who imports whom: fails on a circle of files and on an arrow that ARCHITECTURE.md does not allow.
//!
//! `cargo run -p arrows`, with the folder of another workspace if it is not this one;
//! `cargo run -p arrows -- --list` prints the arrows between rooms with a file that draws each. Imports are
//! `use` lines and paths in the code, followed to the file that holds what they name. Tests may import
//! anything.

mod checks;
mod circles;
mod file;
mod house;
mod rules;
mod tokens;

use checks::Survey;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    let given = std::env::args().skip(1).find(|word| word != "--list").map(PathBuf::from);
    let root = given.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."));
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
