//! Where specs and banks come from: paths, texts, mappings, banks.

use crate::bank::Bank;
use crate::errors::{file_error, refused, refused_in, spec_error};
use crate::values;
use hybank::analog::fit::Measurements;
use hybank::bank;
use hybank::files;
use hybank::spec::{DesignOverrides, Spec};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyTuple};
use std::path::{Path, PathBuf};

/// The spec that `source` is, names or carries: a path, a TOML text of several lines, a mapping, or a bank.
/// A bank stands for its spec with the sizes of the bank.
pub(crate) fn spec(source: &Bound<'_, PyAny>) -> PyResult<Spec> {
    spec_with(source, DesignOverrides::default())
}

/// The same with other keys of `[design]`, which the spec of a bank does not have.
pub(crate) fn spec_with(source: &Bound<'_, PyAny>, keys: DesignOverrides) -> PyResult<Spec> {
    let py = source.py();
    if let Ok(bank) = source.cast::<Bank>() {
        return spec_of_bank(&bank.get().bank, "the bank");
    }
    if let Ok(text) = source.extract::<String>()
        && text.contains('\n')
    {
        return spec_in(py, &text, Path::new("spec"), keys);
    }
    let Some(path) = path(source) else {
        let beside = Measurements::in_folder(PathBuf::new());
        let table = values::table(source)?;
        let spec = Spec::from_data(table, "spec", keys, &|wanted| beside.model(wanted));
        return spec.map_err(|error| spec_error(py, &error));
    };
    let (text, name) = (read(&path)?, path.display().to_string());
    if path.extension().is_some_and(|extension| extension == "json") {
        return spec_of_bank(&parse_bank(&text, &name)?, &name);
    }
    spec_in(py, &text, &path, keys)
}

/// The spec in the text of the file `path`; the measurements that it names are relative to its folder.
fn spec_in(py: Python<'_>, text: &str, path: &Path, keys: DesignOverrides) -> PyResult<Spec> {
    let beside = Measurements::in_folder(path.parent().unwrap_or(Path::new("")).to_owned());
    let name = path.display().to_string();
    Spec::from_toml_and_files(text, &name, keys, &|wanted| beside.model(wanted))
        .map_err(|error| spec_error(py, &error))
}

fn spec_of_bank(bank: &bank::Bank, name: &str) -> PyResult<Spec> {
    bank.sized_spec().ok_or_else(|| {
        refused_in(name, "this bank carries no spec, so its front ends are unknown; give the spec")
    })
}

/// A path, as text or as an object of `pathlib`.
pub(crate) fn path(source: &Bound<'_, PyAny>) -> Option<PathBuf> {
    source.extract().ok()
}

/// The text of a spec or bank file.
pub(crate) fn read(path: &Path) -> PyResult<String> {
    files::read_text(path, files::SPEC_OR_BANK).map_err(file_error)
}

/// A bank that can run.
pub(crate) fn parse_bank(text: &str, name: &str) -> PyResult<bank::Bank> {
    let bank = bank::Bank::from_json(text, name).map_err(refused)?;
    hybank::design::filters::check_stable(&bank).map_err(|error| refused_in(name, error))?;
    Ok(bank)
}

/// The packages whose arrays have names or are lazy.
const FOREIGN: [&str; 3] = ["xarray", "pandas", "dask"];

/// Whether `x` is a file or several, recordings that were read, or an array of such a package.
pub(crate) fn is_foreign(x: &Bound<'_, PyAny>) -> PyResult<bool> {
    let first = match (x.cast::<PyList>(), x.cast::<PyTuple>()) {
        (Ok(list), _) => list.get_item(0).ok(),
        (_, Ok(tuple)) => tuple.get_item(0).ok(),
        _ => None,
    };
    let x = first.as_ref().unwrap_or(x);
    let module = x.get_type().module()?;
    let module = module.to_cow()?;
    let package = module.split('.').next().unwrap_or_default();
    let is_path = x.is_instance_of::<PyString>() || x.hasattr("__fspath__")?;
    Ok(is_path || FOREIGN.contains(&package) || module == "hybank._inputs")
}
