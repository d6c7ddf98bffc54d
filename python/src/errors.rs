//! Errors of the library as Python exceptions.

use hybank::captures::CaptureError;
use hybank::files::FileError;
use hybank::io::{IoError, OfflineError};
use hybank::messages::{Quoted, shown};
use hybank::spec;
use pyo3::create_exception;
use pyo3::exceptions::{PyFileExistsError, PyMemoryError, PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fmt::Display;

create_exception!(
    hybank,
    HybankError,
    PyValueError,
    "Something that hybank refuses, with the rule and the remedy."
);
create_exception!(
    hybank,
    SpecError,
    HybankError,
    "A spec that cannot be used. `path` is the path of keys to the value; `line` and `column`, from 1, are its place \
     in the text, or None for a spec that has no text."
);

/// A refusal of the library. Every message of this package comes this way, or through [`shown`].
pub(crate) fn refused(error: impl Display) -> PyErr {
    HybankError::new_err(shown(&error.to_string()))
}

/// A refusal that names the file first.
pub(crate) fn refused_in(name: &str, error: impl Display) -> PyErr {
    refused(format!("{}: {error}", Quoted(name)))
}

/// The value of a name among the `known` ones; `keyword` is the argument that names it.
pub(crate) fn choose<T: Copy>(keyword: &str, name: &str, known: &[(&str, T)]) -> PyResult<T> {
    known.iter().find(|(known, _)| *known == name).map(|&(_, value)| value).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
        let (last, others) = names.split_last().unwrap_or((&"", &[]));
        let choice = format!("{} or {last}", others.join(", "));
        refused(format!("{keyword}: \"{}\" is unknown; choose {choice}", Quoted(name)))
    })
}

/// A spec that was refused, with its place.
pub(crate) fn spec_error(py: Python<'_>, error: &spec::SpecError) -> PyErr {
    let refused = SpecError::new_err(shown(&error.to_string()));
    let value = refused.value(py);
    let (line, column) = error.location().map(|location| (location.line, location.column)).unzip();
    let set = value
        .setattr("path", error.path())
        .and_then(|()| value.setattr("line", line))
        .and_then(|()| value.setattr("column", column));
    set.err().unwrap_or(refused)
}

/// A fault of a file: what the system refuses is an `OSError` of its kind.
pub(crate) fn file_error(error: FileError) -> PyErr {
    match &error {
        FileError::System { file, source, .. } => match source.raw_os_error() {
            // Python chooses the subclass by the number: FileNotFoundError, PermissionError and so on.
            Some(number) => {
                let text = source.to_string();
                let reason = text.split(" (os error").next().unwrap_or_default().to_owned();
                PyOSError::new_err((number, reason, file.clone()))
            }
            None => PyOSError::new_err(shown(&error.to_string())),
        },
        FileError::Exists { file } => PyFileExistsError::new_err(format!(
            "{}: the file exists; give another name or overwrite=True",
            Quoted(file)
        )),
        _ => refused(error),
    }
}

/// A fault of an input: what the system refuses is an `OSError` of its kind.
pub(crate) fn io_error(error: IoError) -> PyErr {
    match error {
        IoError::File(error) => file_error(error),
        other => refused(other),
    }
}

/// A fault of captures.
pub(crate) fn capture_error(error: CaptureError) -> PyErr {
    match error {
        CaptureError::Io(error) | CaptureError::Samples(OfflineError::Io(error)) => io_error(error),
        CaptureError::Samples(error @ OfflineError::Memory { .. }) => {
            PyMemoryError::new_err(shown(&error.to_string()))
        }
        other => refused(other),
    }
}

/// Refuses keywords beside the one that `function` has. Only for what is called so often that the wrapper of
/// `hybank._keywords`, which does it for all others, would take time.
pub(crate) fn no_others(function: &str, known: &str, unknown: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
    let Some(unknown) = unknown else { return Ok(()) };
    let refuse = unknown.py().import("hybank._keywords")?.getattr("refuse")?;
    refuse.call1((function, unknown, [known])).map(drop)
}

/// A warning at the line that called the package.
pub(crate) fn warn(py: Python<'_>, message: &impl Display) -> PyResult<()> {
    py.import("hybank._warnings")?.call_method1("warn", (shown(&message.to_string()),)).map(drop)
}
