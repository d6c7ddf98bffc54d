//! `hybank.design`.

use crate::background;
use crate::bank::Bank;
use crate::errors::{refused, spec_problem};
use crate::sources;
use hybank::design::{Design, DesignError, Limits, Options, ProofSearch, warnings};
use hybank::messages::shown;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use std::ffi::CString;
use std::fmt::Display;

/// Designs the bank of a spec.
#[pyfunction]
#[pyo3(signature = (source, *, proof, limits, progress))]
pub(crate) fn design(
    source: &Bound<'_, PyAny>,
    proof: bool,
    limits: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bank> {
    let py = source.py();
    let spec = sources::spec(source)?;
    for doubt in warnings(&spec).unwrap_or_default() {
        warn(py, &doubt)?;
    }
    let proof = if proof { ProofSearch::Run } else { ProofSearch::Skip };
    let limits = if limits { Limits::Enforced } else { Limits::Off };
    let designed = background::run(py, progress, move |reporter| {
        let observer = |stage, seconds| reporter.begins(stage, seconds);
        hybank::design::design(&spec, &Options { proof, limits, observer: &observer, stop: reporter.stop() })
    })?;
    let Design { bank, proof: proven, .. } = designed.map_err(|error| match &error {
        DesignError::Spec(problem) => spec_problem(py, problem),
        _ => refused(error),
    })?;
    if let Err(reason) = proven
        && proof == ProofSearch::Run
    {
        warn(py, &format!("gamma is computed, not proven: {reason}"))?;
    }
    Ok(Bank::from(bank))
}

/// A warning at the line of the caller: the one that calls `hybank.design`.
fn warn(py: Python<'_>, message: &impl Display) -> PyResult<()> {
    let text = CString::new(shown(&message.to_string()))?;
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)
}
