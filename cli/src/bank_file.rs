//! Reads specs, with the measurements that they name, and banks.

use super::file_kind::{FileKind, refuse_other};
use super::print::{Failure, InFile, is_dash, name, say_line};
use hybank::analog::fit::{MeasuredResponse, vector_fit};
use hybank::bank::Bank;
use hybank::design::filters;
use hybank::files::{self, Bound, FileError, SPEC_OR_BANK, StandardStream};
use hybank::memory::check_memory;
use hybank::messages::Quoted;
use hybank::quantity::readable;
use hybank::runtime::{Options, Plan};
use hybank::spec::{
    DesignOverrides, FilterModel, MeasuredFilter, Measurement, Spec, SpecProblem, with_measurements_renamed,
};
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Reads a bank file; `-` is standard input.
pub(super) fn load(path: &Path) -> Result<Bank, Failure> {
    let text = read_kind(path, FileKind::Bank)?;
    let bank = Bank::from_json(&text, &name(path)).map_err(Failure::input)?;
    filters::check_stable(&bank).in_file(path)?;
    Ok(bank)
}

/// Compiles the bank of the file `path`, if the process may use as much memory as that takes.
pub(super) fn plan(bank: &Bank, options: Options, path: &Path) -> Result<Plan, Failure> {
    let bytes = bank.plan_bytes(options).in_file(path)?;
    check_memory(bytes).map_err(|shortage| {
        let remedy = "use shorter filters, or --algorithm direct";
        Failure::of(path, format!("to filter with it takes {shortage}; {remedy}"))
    })?;
    bank.plan(options).in_file(path)
}

/// A spec, and the measurements that it names.
pub(super) struct SpecFile {
    spec: Spec,
    models: Models,
}

impl SpecFile {
    /// The spec, unless one of these outputs is a file that it names.
    pub(super) fn for_outputs(&self, outputs: &[&Path]) -> Result<Spec, Failure> {
        let inputs = self.models.files();
        let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
        let outputs: Vec<&Path> = outputs.iter().copied().filter(|path| !is_dash(path)).collect();
        files::refuse_overlaps(&outputs, &inputs).map_err(Failure::input)?;
        Ok(self.spec.clone())
    }

    /// The `text` of this file with the values of `changed`, as [`Spec::to_toml_like`] writes it, for the
    /// file `output`. In another folder it names the measurements by their whole paths.
    pub(super) fn with_values(
        &self,
        text: &str,
        changed: &Spec,
        output: &Path,
    ) -> Result<String, SpecProblem> {
        let written = changed.to_toml_like(text, &|wanted| self.models.model(wanted))?;
        let whole = |folder: &Path| Path::new(".").join(folder).canonicalize().ok();
        let from = whole(&self.models.folder);
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

/// The spec in the text of the file `path`, with the measurements beside it.
pub(super) fn parse_spec(text: &str, path: &Path, overrides: DesignOverrides) -> Result<SpecFile, Failure> {
    let models = Models::beside(path);
    let read = Spec::from_toml_and_files(text, &name(path), overrides, &|wanted| models.model(wanted));
    let spec = read.map_err(|error| match error.overridden() {
        Some(key) => bad_flag(key, error.problem()),
        None => Failure::input(error),
    })?;
    models.echo.take().iter().for_each(|line| say_line(line));
    Ok(SpecFile { spec, models })
}

/// A value of the command line that was given in place of the spec's `key`.
pub(super) fn bad_flag(key: &str, problem: &SpecProblem) -> Failure {
    let flag = if key == "target_snr_db" { "snr".to_owned() } else { key.replace('_', "-") };
    Failure::Input(format!("--{flag}: {problem}"))
}

/// The spec of a spec file, or the one that a bank file carries (with the bank's latency).
pub(super) fn load_spec_or_bank(path: &Path) -> Result<SpecFile, Failure> {
    if path.extension().is_none_or(|extension| extension != "json") {
        return load_spec(path, DesignOverrides::default());
    }
    let bank = load(path)?;
    let latency = Some(bank.latency);
    let spec = bank.spec.ok_or_else(|| {
        Failure::of(path, "this bank carries no spec, so its front ends are unknown; give the spec file")
    })?;
    Ok(SpecFile { spec: Spec { latency, ..spec }, models: Models::beside(path) })
}

/// The text of a file; `-` is standard input.
pub(super) fn read_text(path: &Path) -> Result<String, Failure> {
    files::text_in(read_file(path)?, &name(path)).map_err(Failure::input)
}

fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    let bytes = if is_dash(path) {
        let check = StandardStream::Input.check();
        check.map_err(FileError::system(&name(path), "read it")).map_err(Failure::input)?;
        files::bytes_of(std::io::stdin().lock(), &name(path), SPEC_OR_BANK)
    } else {
        files::read_bytes(path, SPEC_OR_BANK)
    };
    bytes.map_err(Failure::input)
}

/// The text of a bank or a spec, whichever is wanted.
pub(super) fn read_kind(path: &Path, wanted: FileKind) -> Result<String, Failure> {
    let bytes = read_file(path)?;
    refuse_other(&name(path), FileKind::of(&bytes), wanted)?;
    files::text_in(bytes, &name(path)).map_err(Failure::input)
}

/// Largest file of a measurement.
const MEASUREMENT: Bound =
    Bound { bytes: 64 << 20, kind: "a measured response", remedy: "give the file that was meant" };

/// The models of one spec, each fitted once.
struct Models {
    /// The folder of the spec, to which names of files are relative.
    folder: PathBuf,
    made: RefCell<Vec<(MeasuredFilter, FilterModel)>>,
    /// What was understood of them, a line each.
    echo: RefCell<Vec<String>>,
}

impl Models {
    /// Of no measurement yet, for the spec in the file `path`.
    fn beside(path: &Path) -> Self {
        let folder = if is_dash(path) { PathBuf::new() } else { folder(path) };
        Self { folder, made: RefCell::default(), echo: RefCell::default() }
    }

    /// The measurements that were read.
    fn files(&self) -> Vec<PathBuf> {
        self.made.borrow().iter().map(|(made, _)| self.folder.join(&made.path)).collect()
    }

    /// The model of a measurement.
    fn model(&self, wanted: &MeasuredFilter) -> Result<FilterModel, String> {
        let known =
            self.made.borrow().iter().find(|(made, _)| made == wanted).map(|(_, model)| model.clone());
        if let Some(model) = known {
            return Ok(model);
        }
        let path = self.folder.join(&wanted.path);
        let text = files::read_text(&path, MEASUREMENT).map_err(|error| error.to_string())?;
        let named = |error: &dyn std::fmt::Display| format!("{}: {error}", Quoted(&path));
        let measured = response(&path, &text, wanted).map_err(|error| named(&error))?;
        let fitted = vector_fit(&measured.without_delay(wanted.deembed), wanted.order);
        let fitted = fitted.map_err(|error| named(&error))?;
        let points = measured.points();
        let at = |k: usize| points.get(k).map_or(0.0, |point| point.0.0);
        self.echo.borrow_mut().push(format!(
            "{}: {} poles fitted to {} frequencies, {} to {}; error at most {:.2e} dB",
            Quoted(&path),
            wanted.order,
            points.len(),
            readable(at(0), "Hz"),
            readable(at(points.len() - 1), "Hz"),
            fitted.error.0
        ));
        let model = FilterModel { filter: fitted.filter, error: fitted.error };
        self.made.borrow_mut().push((wanted.clone(), model.clone()));
        Ok(model)
    }
}

fn response(path: &Path, text: &str, wanted: &MeasuredFilter) -> Result<MeasuredResponse, String> {
    let Measurement::Touchstone(parameter) = &wanted.measurement else {
        return MeasuredResponse::from_csv(text).map_err(|error| error.to_string());
    };
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let ports = match extension.to_ascii_lowercase().as_str() {
        "s1p" => 1,
        "s2p" => 2,
        _ => return Err("Touchstone files of one or two ports end in .s1p or .s2p".to_owned()),
    };
    MeasuredResponse::from_touchstone(text, ports, parameter.as_deref()).map_err(|error| error.to_string())
}
