//! What calls give back: objects of the classes in `hybank._results`, and reports of the library as records:
//! what `--json` of the command line prints, with the same names.

use crate::errors::refused;
use hybank::bank::Bank;
use hybank::design::DesignError;
use hybank::figures::Figures;
use hybank::units::Decibels;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A `hybank.Record` with the fields of a report. Numbers that are not finite are None.
pub(crate) fn record(py: Python<'_>, report: &impl serde::Serialize) -> PyResult<Py<PyAny>> {
    let text = serde_json::to_string(report).map_err(refused)?;
    Ok(py.import("hybank._results")?.call_method1("record", (text,))?.unbind())
}

/// The same of a report that has a class of its own.
pub(crate) fn of_report<'py>(
    py: Python<'py>,
    class: &str,
    report: &impl serde::Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(report).map_err(refused)?;
    py.import("hybank._results")?.call_method1("result", (class, text))
}

/// A result of a class in the making.
pub(crate) struct Made<'py> {
    class: Bound<'py, PyAny>,
    fields: Bound<'py, PyDict>,
}

impl<'py> Made<'py> {
    pub(crate) fn new(py: Python<'py>, class: &str) -> PyResult<Self> {
        Ok(Self { class: py.import("hybank._results")?.getattr(class)?, fields: PyDict::new(py) })
    }

    /// With the fields of a report.
    pub(crate) fn of(py: Python<'py>, class: &str, report: &impl serde::Serialize) -> PyResult<Self> {
        let made = Self::new(py, class)?;
        made.fields.call_method1("update", (record(py, report)?,))?;
        Ok(made)
    }

    pub(crate) fn with(self, name: &str, value: impl IntoPyObject<'py>) -> PyResult<Self> {
        self.fields.set_item(name, value)?;
        Ok(self)
    }

    pub(crate) fn object(self) -> PyResult<Bound<'py, PyAny>> {
        self.class.call((), Some(&self.fields))
    }
}

/// A bank in the user's terms.
#[derive(serde::Serialize)]
pub(crate) struct FiguresReport {
    #[serde(flatten)]
    figures: Figures,
    gain_over_usual_ways_db: Option<Decibels>,
}

impl FiguresReport {
    pub(crate) fn new(bank: &Bank) -> Result<Self, DesignError> {
        let figures = Figures::new(bank)?;
        Ok(Self { gain_over_usual_ways_db: figures.gain_over_usual_ways(), figures })
    }
}
