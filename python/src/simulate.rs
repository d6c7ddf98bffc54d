//! `hybank.simulate`.

use crate::background;
use crate::errors::{HybankError, refused};
use crate::results::Capture;
use crate::sources;
use hybank::design::{self, Problem};
use hybank::simulate::{Analog, Captured, Recording, Source, capture, frames};
use hybank::spec::Spec;
use hybank::units::{FastPeriods, Hertz};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyString;

/// What virtual converters capture of a signal: a text like `chirp:50Hz..8kHz@1s`, or samples.
#[pyfunction]
#[pyo3(signature = (source, signal, *, samples = None, gain = 1.0, rate = None))]
pub(crate) fn simulate(
    source: &Bound<'_, PyAny>,
    signal: &Bound<'_, PyAny>,
    samples: Option<usize>,
    gain: f64,
    rate: Option<f64>,
) -> PyResult<Capture> {
    let py = source.py();
    if !gain.is_finite() {
        return Err(HybankError::new_err(format!("gain: {gain} is not a finite number")));
    }
    let spec = sources::spec(source)?;
    let latency = design::latency(&spec).map_err(refused)?;
    let problem = Problem::new(&spec, latency).map_err(refused)?;
    let signal = analog(&spec, signal, rate)?;
    let samples = samples.unwrap_or_else(|| signal.usual_samples(spec.ratio));
    let frames = frames(&problem, &signal, samples, false).map_err(refused)?;
    let captured = background::run(py, None, move |_| capture(&problem, &signal, frames))?;
    delivered(py, &spec, captured, gain, latency)
}

/// The signal in normalised time.
fn analog(spec: &Spec, signal: &Bound<'_, PyAny>, rate: Option<f64>) -> PyResult<Analog> {
    if let Ok(text) = signal.cast::<PyString>() {
        let source: Source = text.to_cow()?.parse().map_err(refused)?;
        return Ok(Analog::Known(source.normalised(spec.fast_period)));
    }
    let fast = spec.fast_period.rate();
    let rate = rate.map_or(fast, Hertz);
    if !(rate.0 > 0.0 && rate.0.is_finite()) {
        return Err(HybankError::new_err(format!(
            "rate: {} is no sample rate; give samples per second",
            rate.0
        )));
    }
    let recording = Recording::new(&signal.extract::<Vec<f64>>()?, FastPeriods(fast / rate));
    Ok(Analog::Recorded(recording))
}

/// The samples as the converters deliver them: with the gain of the signal and the offsets of the spec.
fn delivered(
    py: Python<'_>,
    spec: &Spec,
    captured: Captured,
    gain: f64,
    latency: usize,
) -> PyResult<Capture> {
    let Captured { mut channels, mut target } = captured;
    for (samples, channel) in channels.iter_mut().zip(&spec.channels) {
        samples.iter_mut().for_each(|x| *x = *x * gain + channel.offset);
    }
    target.iter_mut().for_each(|x| *x *= gain);
    Ok(Capture {
        channels: PyArray2::from_vec2(py, &channels)?.unbind(),
        target: PyArray1::from_vec(py, target).unbind(),
        latency,
    })
}
