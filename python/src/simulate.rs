//! `hybank.simulate`.

use crate::arrays::{ArrayShape, Held};
use crate::background;
use crate::errors::refused;
use crate::results::Made;
use crate::sources;
use crate::values::{numbers, shares, times};
use hybank::captures::ChannelSamples;
use hybank::design::Problem;
use hybank::simulate::{Analog, ComplexSource, Delivered, ErrorLists, Periodic, Signal, Source};
use hybank::spec::Spec;
use hybank::units::{FastPeriods, Hertz};
use numpy::{Complex64, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString};

/// What virtual converters capture of a signal: a text like `chirp:50Hz..8kHz@1s`, or samples.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub(crate) fn simulate<'py>(
    source: &Bound<'py, PyAny>,
    signal: &Bound<'_, PyAny>,
    imaginary: Option<&Bound<'_, PyAny>>,
    samples: Option<usize>,
    gain: f64,
    rate: Option<f64>,
    noise: f64,
    bits: Option<u32>,
    jitter: Option<&Bound<'_, PyAny>>,
    drift: Option<&Bound<'_, PyAny>>,
    delay_error: Option<&Bound<'_, PyAny>>,
    gain_error: Option<&Bound<'_, PyAny>>,
    cutoff_error: Option<&Bound<'_, PyAny>>,
    offset: Option<&Bound<'_, PyAny>>,
    seed: u64,
) -> PyResult<Bound<'py, PyAny>> {
    let py = source.py();
    if !gain.is_finite() {
        return Err(refused(format!("gain: {gain} is not a finite number")));
    }
    let errors = ErrorLists {
        noise,
        bits,
        jitter: times("jitter", jitter)?.first().copied(),
        drift: numbers(drift)?,
        delay_error: times("delay_error", delay_error)?,
        gain_error: shares("gain_error", gain_error)?,
        cutoff_error: shares("cutoff_error", cutoff_error)?,
        offset: numbers(offset)?,
        seed,
    };
    let spec = sources::spec(source)?;
    // As the command does: the converters do not know what the spec says of the signal. Without latency the
    // target lies on the time axis of the output of `Bank.fuse`.
    let truth = Spec { signal: None, ..errors.true_spec(&spec).map_err(refused)? };
    let problem = Problem::new(&truth, spec.wait()).map_err(refused)?;
    let signal = analog(&spec, signal, imaginary, rate)?;
    let converters = errors.converters(&spec, signal.parts()).map_err(refused)?;
    let frames = signal.frames(&problem, samples, errors.is_jittered()).map_err(refused)?;
    let (captured, target) = background::run(py, None, move |_| {
        let each = converters.iter().enumerate();
        let each = each.map(|(i, each)| signal.captured(&problem, i, &each.converter, gain, frames));
        (each.collect::<Vec<_>>(), signal.target(&problem, gain, frames))
    })?;
    let clipped: Vec<usize> = captured.iter().map(|one| one.clipped).collect();
    let target = match &target.1 {
        None => PyArray1::from_vec(py, target.0).into_any(),
        Some(imaginary) => PyArray1::from_vec(py, complex(&target.0, imaginary)).into_any(),
    };
    let made = Made::new(py, "Capture")?.with("channels", channels(py, captured)?)?;
    made.with("target", target)?.with("clipped", clipped)?.object()
}

/// The samples of all converters.
fn channels(py: Python<'_>, captured: Vec<Delivered>) -> PyResult<Bound<'_, PyAny>> {
    if captured.iter().all(|one| one.imaginary.is_none()) {
        return rows(py, captured.into_iter().map(|one| one.samples).collect());
    }
    let both = |one: Delivered| complex(&one.samples, &one.imaginary.unwrap_or_default());
    rows(py, captured.into_iter().map(both).collect())
}

/// The analog signal of texts or of samples at `rate`.
fn analog(
    spec: &Spec,
    signal: &Bound<'_, PyAny>,
    imaginary: Option<&Bound<'_, PyAny>>,
    rate: Option<f64>,
) -> PyResult<Signal> {
    let found = part(spec, signal, rate)?;
    let Some(imaginary) = imaginary else { return Ok(found) };
    let other = match imaginary.cast::<PyString>() {
        Ok(text) => {
            let source: Source =
                text.to_cow()?.parse().map_err(|error| refused(format!("imaginary: {error}")))?;
            Signal { real: Analog::Known(source.normalised(spec.fast_period)), imaginary: None }
        }
        Err(_) => part(spec, imaginary, rate)?,
    };
    if found.imaginary.is_some() || other.imaginary.is_some() {
        return Err(refused("imaginary: both parts are real signals, and one of these is complex"));
    }
    Ok(Signal { imaginary: Some(other.real), ..found })
}

fn part(spec: &Spec, signal: &Bound<'_, PyAny>, rate: Option<f64>) -> PyResult<Signal> {
    if let Ok(text) = signal.cast::<PyString>() {
        let source: ComplexSource = text.to_cow()?.parse().map_err(refused)?;
        return Ok(Signal::of_source(&source, spec.fast_period));
    }
    let fast = spec.fast_period.rate();
    let rate = rate.map_or(fast, Hertz);
    if !(rate.0 > 0.0 && rate.0.is_finite()) {
        return Err(refused(format!("rate: {} is no sample rate; give samples per second", rate.0)));
    }
    let held = Held::new(signal, ArrayShape::MONO)?;
    let channel = held.captures()?.channels.into_iter().next().unwrap_or_default();
    let ChannelSamples { samples, imaginary, .. } = channel.finite().map_err(refused)?;
    let part = |samples: &[f64]| Analog::Recorded(Periodic::new(samples, FastPeriods(fast / rate)));
    Ok(Signal { real: part(&samples), imaginary: imaginary.as_deref().map(part) })
}

/// An array with a row for each converter; a list of arrays where these have rates of their own.
fn rows<T: numpy::Element + Clone>(py: Python<'_>, rows: Vec<Vec<T>>) -> PyResult<Bound<'_, PyAny>> {
    if rows.windows(2).all(|pair| pair[0].len() == pair[1].len()) {
        return Ok(PyArray2::from_vec2(py, &rows)?.into_any());
    }
    Ok(PyList::new(py, rows.into_iter().map(|row| PyArray1::from_vec(py, row)))?.into_any())
}

fn complex(real: &[f64], imaginary: &[f64]) -> Vec<Complex64> {
    real.iter().zip(imaginary).map(|(&re, &im)| Complex64::new(re, im)).collect()
}
