//! `hybank.merge`.

use crate::align::record_of;
use crate::background;
use crate::errors::{refused, warn};
use crate::results::{Made, record};
use hybank::merge::{self as merging, MergeSettings, Merged, Recorder, SourceEstimate};
use hybank::units::{Hertz, Seconds};
use numpy::PyArray1;
use pyo3::prelude::*;

/// Recordings of one event, each with its rate and, if all have them, the times of its samples.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub(crate) fn merge<'py>(
    py: Python<'py>,
    x: Vec<Bound<'py, PyAny>>,
    rates: Vec<f64>,
    times: Option<Vec<Vec<f64>>>,
    output_rate: Option<f64>,
    band: Option<f64>,
    flat: bool,
    within: Option<f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let mut stamps = times.into_iter().flatten();
    let source = |(i, (x, rate)): (usize, (&Bound<'py, PyAny>, f64))| {
        let record = record_of(x)?;
        let stamps: Option<Vec<Seconds>> = stamps.next().map(|all| all.into_iter().map(Seconds).collect());
        if stamps.as_ref().is_some_and(|stamps| stamps.len() != record.samples.len()) {
            return Err(refused(format!("times[{i}]: give one time for each sample of x[{i}]")));
        }
        Ok(Recorder { name: format!("x[{i}]"), record, rate: Hertz(rate), step: 0.0, stamps })
    };
    let sources = x.iter().zip(rates).enumerate().map(source).collect::<PyResult<Vec<_>>>()?;
    let settings = MergeSettings {
        rate: output_rate.map(Hertz),
        band: band.map(Hertz),
        learn: !flat,
        within: within.map(Seconds),
    };
    let found = background::run(py, None, move |_| merging::merge(&sources, settings))?;
    result(py, found.map_err(refused)?)
}

fn result(py: Python<'_>, found: Merged) -> PyResult<Bound<'_, PyAny>> {
    let column = |of: &dyn Fn(&SourceEstimate) -> f64| PyArray1::from_iter(py, found.sources.iter().map(of));
    let optional = |of: &dyn Fn(&SourceEstimate) -> Option<f64>| {
        let values: Option<Vec<f64>> = found.sources.iter().map(of).collect();
        values.map(|values| PyArray1::from_vec(py, values))
    };
    let steps_of = |one: &SourceEstimate| one.steps.iter().map(|step| record(py, step)).collect();
    let steps = found.sources.iter().map(steps_of).collect::<PyResult<Vec<Vec<_>>>>()?;
    found.warnings.iter().try_for_each(|warning| warn(py, warning))?;
    let quality = &found.quality;
    Made::new(py, "Merged")?
        .with("start", column(&|one| one.start.0))?
        .with("drift_ppm", optional(&|one| one.drift.map(|drift| 1e6 * drift.value)))?
        .with("gain", optional(&|one| one.gain.map(|gain| gain.value)))?
        .with("noise", column(&|one| one.noise))?
        .with("steps", steps)?
        .with("rate", found.rate.0)?
        .with("first", found.first)?
        .with("begin", found.begin.0)?
        .with("snr_db", quality.snr.0)?
        .with("worst_second_db", quality.worst_second.0)?
        .with("worst_second_at", quality.worst_at.0)?
        .with("alone_db", quality.alone.iter().map(|alone| alone.0).collect::<Vec<_>>())?
        .with("mean_db", quality.mean.0)?
        .with("one_suffices", quality.sufficient().map(|i| i + 1))?
        .with("warnings", found.warnings.iter().map(ToString::to_string).collect::<Vec<_>>())?
        .with("samples", PyArray1::from_vec(py, found.samples))?
        .object()
}
