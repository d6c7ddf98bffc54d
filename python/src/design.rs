//! `hybank.design` and `hybank.import_taps`.

use crate::background;
use crate::bank::Bank;
use crate::errors::{refused, spec_error, warn};
use crate::{sources, values};
use hybank::design::{Design, DesignError, DesignOptions, ProofSearch, TIME_LIMIT, judge_taps, warnings};
use hybank::spec::DesignOverrides;
use pyo3::prelude::*;

/// Designs the bank of a spec, with `latency` and the keys of `[design]` in `keys` in place of its own.
#[pyfunction]
pub(crate) fn design(
    source: &Bound<'_, PyAny>,
    keys: &Bound<'_, PyAny>,
    latency: Option<usize>,
    proof: bool,
    limit: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bank> {
    let py = source.py();
    let keys = DesignOverrides::from_data(values::table(keys)?, "design");
    let mut spec = sources::spec_with(source, keys.map_err(|error| spec_error(py, &error))?)?;
    spec.latency = latency.or(spec.latency);
    for warning in warnings(&spec).unwrap_or_default() {
        warn(py, &warning)?;
    }
    let proof = if proof { ProofSearch::Run } else { ProofSearch::Skip };
    let time_limit = limit.then_some(TIME_LIMIT);
    let designed = background::run(py, progress, move |reporter| {
        let observer = |stage| reporter.begins(stage);
        let stop = reporter.stop();
        hybank::design::design(&spec, &DesignOptions { proof, time_limit, observer: &observer, stop })
    })?;
    finished(py, designed, proof)
}

/// The bank of taps from elsewhere, a row per sample of a frame.
#[pyfunction]
pub(crate) fn import_taps(
    source: &Bound<'_, PyAny>,
    taps: Vec<Vec<f64>>,
    latency: Option<usize>,
    proof: bool,
) -> PyResult<Bank> {
    let py = source.py();
    let mut spec = sources::spec(source)?;
    spec.latency = latency.or(spec.latency);
    if spec.latency.is_none() {
        return Err(refused(
            "latency: the spec gives none, which taps from elsewhere have; give the delay of their output in fast samples",
        ));
    }
    let proof = if proof { ProofSearch::Run } else { ProofSearch::Skip };
    finished(py, background::run(py, None, move |_| judge_taps(&spec, taps, proof))?, proof)
}

fn finished(py: Python<'_>, found: Result<Design, DesignError>, proof: ProofSearch) -> PyResult<Bank> {
    let Design { bank, proof: proven, .. } = found.map_err(|error| match &error {
        DesignError::Spec(error) => spec_error(py, error),
        _ => refused(error),
    })?;
    if let Err(reason) = proven
        && proof == ProofSearch::Run
    {
        warn(py, &format!("gamma is computed, not proven: {reason}"))?;
    }
    Ok(Bank::from(bank))
}
