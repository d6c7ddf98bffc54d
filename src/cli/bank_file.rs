//! Reads specs and banks, and writes text files.

use super::Failure;
use super::file_kind::{FileKind, refuse_other};
use super::interrupt::remove_unfinished;
use super::measured::Models;
use super::print::print_bytes;
use super::say::{name_leftovers, say_line};
use crate::bank::Bank;
use crate::design::filters;
use crate::files::{self, AtomicFile, Bound};
use crate::memory::available_memory;
use crate::runtime::{Options, Plan};
use crate::spec::{DesignOverrides, Spec, SpecProblem};
use std::io::Write;
use std::path::Path;

/// Maximum size of a spec or bank file; the largest bank with its proof is smaller.
const TEXT_FILE: Bound =
    Bound { bytes: 256 << 20, kind: "a spec or bank file", remedy: "give the file that was meant" };

/// Bytes of memory that a number of a bank takes while it is read.
const VALUE_BYTES: f64 = 200.0;

/// Whether a path stands for standard input or output.
pub(super) fn is_dash(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Reads a bank file; `-` is standard input.
pub(super) fn load(path: &Path) -> Result<Bank, Failure> {
    let text = read_kind(path, FileKind::Bank)?;
    let values = text.bytes().filter(|&byte| byte == b',').count() as f64;
    check_memory(path, "to read it", VALUE_BYTES * values, "give the file that was meant")?;
    let bank = Bank::from_json(&text, &name(path)).map_err(Failure::input)?;
    filters::check_stable(&bank).map_err(|error| Failure::Input(format!("{}: {error}", name(path))))?;
    Ok(bank)
}

/// Compiles the bank of the file `path`, if the process may use as much memory as that takes.
pub(super) fn plan(bank: &Bank, options: Options, path: &Path) -> Result<Plan, Failure> {
    let in_file = |error| Failure::Input(format!("{}: {error}", name(path)));
    let bytes = bank.plan_bytes(options).map_err(in_file)?;
    check_memory(path, "to filter with it", bytes, "use shorter filters, or --algorithm direct")?;
    bank.plan(options).map_err(in_file)
}

/// Refuses work on the file `path` for which there is no memory; the system would end the process.
fn check_memory(path: &Path, work: &str, bytes: f64, remedy: &str) -> Result<(), Failure> {
    match available_memory() {
        Some(memory) if bytes > memory => Err(Failure::Input(format!(
            "{}: {work} takes about {:.1} GB of memory, and this process may use {:.1} GB; {remedy}",
            name(path),
            bytes / 1e9,
            memory / 1e9
        ))),
        _ => Ok(()),
    }
}

/// Reads a spec file; `-` is standard input.
pub(super) fn load_spec(path: &Path, overrides: DesignOverrides) -> Result<Spec, Failure> {
    let text = read_kind(path, FileKind::Spec)?;
    parse_spec(&text, path, overrides)
}

/// The spec in the text of the file `path`, with the measurements beside it.
pub(super) fn parse_spec(text: &str, path: &Path, overrides: DesignOverrides) -> Result<Spec, Failure> {
    let folder = path.parent().filter(|_| !is_dash(path)).unwrap_or(Path::new(""));
    let models = Models::beside(folder);
    let read = Spec::from_toml_and_files(text, &name(path), overrides, &|wanted| models.model(wanted));
    let spec = read.map_err(|error| match error.overridden() {
        Some(key) => bad_flag(key, error.problem()),
        None => Failure::input(error),
    })?;
    models.echo().iter().for_each(|line| say_line(line));
    Ok(spec)
}

/// A value of the command line that was given in place of the spec's `key`.
pub(super) fn bad_flag(key: &str, problem: &SpecProblem) -> Failure {
    let flag = if key == "target_snr_db" { "snr".to_owned() } else { key.replace('_', "-") };
    Failure::Input(format!("--{flag}: {problem}"))
}

/// The spec of a spec file, or the one that a bank file carries (with the bank's latency).
pub(super) fn load_spec_or_bank(path: &Path) -> Result<Spec, Failure> {
    if path.extension().is_none_or(|extension| extension != "json") {
        return load_spec(path, DesignOverrides::default());
    }
    let bank = load(path)?;
    let latency = Some(bank.latency);
    let spec = bank.spec.ok_or_else(|| {
        Failure::Input(format!(
            "{}: this bank carries no spec, so its front ends are unknown; give the spec file",
            name(path)
        ))
    })?;
    Ok(Spec { latency, ..spec })
}

/// Refuses an output file that is also the input, and names what a killed run left beside it.
pub(super) fn refuse_overlap(output: &Path, input: &Path) -> Result<(), Failure> {
    if is_dash(output) {
        return Ok(());
    }
    files::refuse_overlaps(&[output], &[input]).map_err(Failure::input)?;
    name_leftovers(&[output]);
    Ok(())
}

/// Writes a text file that appears when it is whole; `-` is standard output.
pub(super) fn write_text(path: &Path, text: &str, force: bool) -> Result<(), Failure> {
    write_bytes(path, text.as_bytes(), force)
}

/// As [`write_text`], for any bytes.
pub(super) fn write_bytes(path: &Path, bytes: &[u8], force: bool) -> Result<(), Failure> {
    if is_dash(path) {
        return print_bytes(bytes);
    }
    begin_file(path, bytes, force)?.commit().map_err(Failure::input)
}

/// A file that is whole but has no name yet.
pub(super) fn begin_file(path: &Path, bytes: &[u8], force: bool) -> Result<AtomicFile, Failure> {
    remove_unfinished();
    let mut file = AtomicFile::create(path, force).map_err(Failure::input)?;
    file.write_all(bytes)
        .map_err(|error| Failure::Input(format!("{}: cannot write it: {error}", name(path))))?;
    Ok(file)
}

/// The name of a file in messages.
pub(super) fn name(path: &Path) -> String {
    if is_dash(path) { "standard input".to_owned() } else { path.display().to_string() }
}

/// The text of a file; `-` is standard input.
pub(super) fn read_text(path: &Path) -> Result<String, Failure> {
    files::text_in(read_file(path)?, &name(path)).map_err(Failure::input)
}

/// The text of a bank or a spec, whichever is wanted.
pub(super) fn read_kind(path: &Path, wanted: FileKind) -> Result<String, Failure> {
    let bytes = read_file(path)?;
    refuse_other(&name(path), FileKind::of(&bytes), wanted)?;
    files::text_in(bytes, &name(path)).map_err(Failure::input)
}

fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    let bytes = if is_dash(path) {
        files::bytes_of(std::io::stdin().lock(), &name(path), TEXT_FILE)
    } else {
        files::read_bytes(path, TEXT_FILE)
    };
    bytes.map_err(Failure::input)
}
