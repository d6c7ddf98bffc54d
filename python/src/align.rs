//! `hybank.align`.

use crate::arrays::{ArrayShape, Held};
use crate::background;
use crate::calibrate::reference_of;
use crate::errors::{refused, warn};
use crate::results::{Made, record};
use crate::sources;
use hybank::align::{self as alignment, AlignSettings, AlignedChannel, Alignment};
use hybank::calibrate::Record;
use hybank::figures::Alone;
use hybank::units::Seconds;
use numpy::PyArray1;
use pyo3::prelude::*;

/// When recordings began, one per channel: how their clocks drift, their polarities, gains and offsets.
#[pyfunction]
#[pyo3(signature = (x, spec, reference, within))]
pub(crate) fn align<'py>(
    x: Vec<Bound<'py, PyAny>>,
    spec: &Bound<'py, PyAny>,
    reference: Option<usize>,
    within: Option<f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = spec.py();
    let spec = sources::spec(spec)?;
    if within.is_some_and(|time| time.is_nan() || time < 0.0) {
        return Err(refused("within: give a time in seconds, not negative"));
    }
    let all = x.iter().map(record_of).collect::<PyResult<Vec<_>>>()?;
    let settings = AlignSettings { reference: reference_of(&spec, reference)?, within: within.map(Seconds) };
    let found = background::run(py, None, move |_| {
        let found = alignment::align(&spec, &all, settings).map_err(|error| error.to_string())?;
        let alone = found.alone().map_err(|error| error.to_string())?;
        Ok::<_, String>((found, alone))
    })?;
    let (found, alone) = found.map_err(refused)?;
    result(py, &found, alone)
}

pub(crate) fn record_of(x: &Bound<'_, PyAny>) -> PyResult<Record> {
    let captures = Held::new(x, ArrayShape::MONO)?.captures()?;
    Ok(captures.channels.first().map_or_else(|| Record::new(Vec::new()), |channel| channel.record(None)))
}

fn result<'py>(py: Python<'py>, found: &Alignment, alone: Alone) -> PyResult<Bound<'py, PyAny>> {
    let column = |of: fn(&AlignedChannel) -> f64| PyArray1::from_iter(py, found.channels.iter().map(of));
    let steps_of = |i: usize| found.instants(i).steps().iter().map(|step| record(py, step)).collect();
    let steps = (0..found.channels.len()).map(steps_of).collect::<PyResult<Vec<Vec<_>>>>()?;
    let lines = found.readings.iter().map(|reading| reading.line() + "\n");
    found.warnings.iter().try_for_each(|warning| warn(py, warning))?;
    Made::new(py, "Alignment")?
        .with("spec", found.spec.to_toml().map_err(refused)?)?
        .with("skip", found.channels.iter().map(|channel| channel.skip).collect::<Vec<_>>())?
        .with("reference", found.reference + 1)?
        .with("frames", found.frames)?
        .with("pieces", found.pieces)?
        .with("measured", found.measured)?
        .with("delay", column(|channel| channel.delay.value.0))?
        .with("drift_ppm", column(|channel| 1e6 * channel.drift.value))?
        .with("gain", column(|channel| channel.gain.value))?
        .with("offset", column(|channel| channel.offset.value))?
        .with("steps", steps)?
        .with("track", lines.collect::<String>())?
        .with("alone", record(py, &alone)?)?
        .with("one_suffices", alone.suffices())?
        .with("moves", found.moves())?
        .with("warnings", found.warnings.iter().map(ToString::to_string).collect::<Vec<_>>())?
        .object()
}
