//! Reports of the library as Python objects: what `--json` of the command line prints, with the same names.

use crate::errors::refused;
use pyo3::prelude::*;

/// A `hybank.Record` with the fields of a report. Numbers that are not finite are None.
pub(crate) fn record(py: Python<'_>, report: &impl serde::Serialize) -> PyResult<Py<PyAny>> {
    let text = serde_json::to_string(report).map_err(refused)?;
    Ok(py.import("hybank._results")?.call_method1("record", (text,))?.unbind())
}

/// The same of a report that may not be there.
pub(crate) fn any(py: Python<'_>, report: Option<&impl serde::Serialize>) -> PyResult<Option<Py<PyAny>>> {
    report.map(|report| record(py, report)).transpose()
}
