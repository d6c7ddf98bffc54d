//! What calls give back: objects of the classes in `hybank._results`, and reports of the library as records:
//! what `--json` of the command line prints, with the same names.

use crate::errors::refused;
use hybank::figures::{Figures, SimpleFigure};
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

    pub(crate) fn with(self, name: &str, value: impl IntoPyObject<'py>) -> PyResult<Self> {
        self.fields.set_item(name, value)?;
        Ok(self)
    }

    pub(crate) fn object(self) -> PyResult<Bound<'py, PyAny>> {
        self.class.call((), Some(&self.fields))
    }
}

/// A bank in the user's terms.
pub(crate) fn figures(py: Python<'_>, found: Figures) -> PyResult<Bound<'_, PyAny>> {
    let simple = |way: &SimpleFigure| (way.way.name(), way.channel, way.snr_db.0);
    Made::new(py, "Figures")?
        .with("band", (found.band.low_hertz.0, found.band.high_hertz.0))?
        .with("snr", found.snr.total_db.0)?
        .with("snr_signal", found.snr.signal_db.0)?
        .with("snr_noise", found.snr.noise_db.map(|db| db.0))?
        .with("snr_delays", found.snr.delays_db.map(|db| db.0))?
        .with("snr_16_bits", found.snr_16_bits_db.map(|db| db.0))?
        .with("image", found.image.map(|image| image.db.0))?
        .with("image_frequency", found.image.map(|image| image.hertz.0))?
        .with("gain_error", found.gain_error.map(|error| error.db.0))?
        .with("gain_error_frequency", found.gain_error.map(|error| error.hertz.0))?
        .with("simple", found.simple.iter().map(simple).collect::<Vec<_>>())?
        .with("gain_over_simple", found.gain_over_simple().map(|db| db.0))?
        .with("any_input", found.any_input)?
        .object()
}
