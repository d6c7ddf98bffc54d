//! Reads specs, with the measurements that they name, and banks.

use super::file_kind::{FileKind, refuse_other};
use super::print::{Failure, InFile, failed, failed_at, is_dash, name, say_line};
use hybank::analog::fit::Measurements;
use hybank::bank::Bank;
use hybank::design::filters;
use hybank::files::{self, SPEC_OR_BANK};
use hybank::spec::{DesignOverrides, Spec, SpecError, SpecProblem, with_measurements_renamed};
use std::path::{Path, PathBuf};

/// Reads a bank file; `-` is standard input.
pub(super) fn load(path: &Path) -> Result<Bank, Failure> {
    let text = read_kind(path, FileKind::Bank)?;
    let bank = Bank::from_json(&text, &name(path)).map_err(failed)?;
    filters::check_stable(&bank).in_file(path)?;
    Ok(bank)
}

/// A spec, and the measurements that it names.
pub(super) struct SpecFile {
    spec: Spec,
    measurements: Measurements,
}

impl SpecFile {
    /// The spec, unless one of these outputs is a file that it names.
    pub(super) fn for_outputs(&self, outputs: &[&Path]) -> Result<Spec, Failure> {
        let inputs = self.measurements.files();
        let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
        let outputs: Vec<&Path> = outputs.iter().copied().filter(|path| !is_dash(path)).collect();
        files::refuse_overlaps(&outputs, &inputs).map_err(failed)?;
        Ok(self.spec.clone())
    }

    /// The `text` of this file with the values of `changed`, as [`Spec::to_toml_like`] writes it, for the
    /// file `output`. In another folder it names the measurements by their whole paths.
    pub(super) fn with_values(&self, text: &str, changed: &Spec, output: &Path) -> Result<String, SpecError> {
        let written = changed.to_toml_like(text, &|wanted| self.measurements.model(wanted))?;
        let whole = |folder: &Path| Path::new(".").join(folder).canonicalize().ok();
        let from = whole(self.measurements.folder());
        if is_dash(output) || from == whole(&folder(output)) {
            return Ok(written);
        }
        Ok(with_measurements_renamed(&written, |path| Some(from.as_ref()?.join(path).to_str()?.to_owned())))
    }
}

/// Reads a spec file; `-` is standard input.
pub(super) fn load_spec(path: &Path, overrides: DesignOverrides) -> Result<SpecFile, Failure> {
    let text = read_kind(path, FileKind::Spec)?;
    parse_spec(&text, path, overrides)
}

/// The folder of a file; empty where that is the present one.
fn folder(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_owned()
}

/// The measurements beside the file `path`; `-` has those of the present folder.
fn beside(path: &Path) -> Measurements {
    Measurements::in_folder(if is_dash(path) { PathBuf::new() } else { folder(path) })
}

/// The spec in the text of the file `path`, with the measurements beside it.
pub(super) fn parse_spec(text: &str, path: &Path, overrides: DesignOverrides) -> Result<SpecFile, Failure> {
    let measurements = beside(path);
    let read = Spec::from_toml_and_files(text, &name(path), overrides, &|wanted| measurements.model(wanted));
    let spec = read.map_err(|error| match error.overridden() {
        Some(key) => bad_flag(key, error.problem()),
        None => failed(error),
    })?;
    measurements.echo().iter().for_each(|line| say_line(line));
    Ok(SpecFile { spec, measurements })
}

/// A value of the command line that was given in place of the spec's `key`.
pub(super) fn bad_flag(key: &str, problem: &SpecProblem) -> Failure {
    let flag = match key {
        "target_snr_db" => "snr".to_owned(),
        "target_sfdr_db" => "sfdr".to_owned(),
        _ => key.replace('_', "-"),
    };
    Failure::Input(format!("--{flag}: {problem}"))
}

/// The spec of a spec file, or the one that a bank file carries, with the bank's sizes.
pub(super) fn load_spec_or_bank(path: &Path) -> Result<SpecFile, Failure> {
    if path.extension().is_none_or(|extension| extension != "json") {
        return load_spec(path, DesignOverrides::default());
    }
    let bank = load(path)?;
    let spec = bank.sized_spec().ok_or_else(|| {
        failed_at(path, "this bank carries no spec, so its front ends are unknown; give the spec file")
    })?;
    Ok(SpecFile { spec, measurements: beside(path) })
}

/// The bytes of a file; `-` is standard input.
fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    let bytes = if is_dash(path) {
        files::bytes_of(std::io::stdin().lock(), &name(path), SPEC_OR_BANK)
    } else {
        files::read_bytes(path, SPEC_OR_BANK)
    };
    bytes.map_err(failed)
}

/// The text of a bank or a spec, whichever is wanted.
pub(super) fn read_kind(path: &Path, wanted: FileKind) -> Result<String, Failure> {
    let bytes = read_file(path)?;
    refuse_other(&name(path), FileKind::of(&bytes), wanted)?;
    files::text_in(bytes, &name(path)).map_err(failed)
}
