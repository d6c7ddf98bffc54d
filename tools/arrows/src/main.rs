//! What is promised about names: who may import whom, and what users can name.
//!
//! `cargo run -p arrows` fails on a circle of files, on an arrow that ARCHITECTURE.md does not allow, and on
//! a public interface that differs from its list in `api/`. Imports are `use` lines and paths in the code,
//! followed to the file that holds what they name. Tests may import anything. `cargo run -p arrows accept`
//! writes the lists again, for review.

mod api;
mod checks;
mod imports;
#[cfg(test)]
mod tests;

use imports::Imports;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let accepts = std::env::args().nth(1).is_some_and(|word| word == "accept");
    let accept = || api::accept(&root, &Imports::read(&root)?.files).map(|()| Vec::new());
    let found = if accepts { accept() } else { faults(&root) };
    let faults = found.unwrap_or_else(|error| vec![format!("arrows: {error}")]);
    faults.iter().for_each(|fault| eprintln!("{fault}"));
    ExitCode::from(u8::from(!faults.is_empty()))
}

/// Every fault of the workspace in this folder.
fn faults(root: &Path) -> Result<Vec<String>, String> {
    let imports = Imports::read(root)?;
    let interfaces = api::faults(root, &imports.files)?;
    Ok([checks::faults(root, imports)?, interfaces].concat())
}
