//! `hybank.simulate`.

use crate::background;
use crate::errors::{HybankError, refused};
use crate::results::Capture;
use crate::sources;
use hybank::design::{self, Problem};
use hybank::simulate::{Analog, Captured, Recording, Source, capture, panels};
use hybank::spec::Spec;
use hybank::units::{FastPeriods, Hertz};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyString;

/// Fast samples of a signal that does not say how long it is.
const DEFAULT_SAMPLES: f64 = 200.0;
/// Most fast samples: 2 GiB.
const MOST_SAMPLES: usize = 1 << 28;
/// Most steps of integration per converter: about ten seconds.
const MOST_PANELS: f64 = 2e7;

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
    let (signal, length) = analog(&spec, signal, rate)?;
    let samples = samples.unwrap_or(length);
    check_work(&problem, &signal, samples)?;
    let frames = samples.div_ceil(spec.ratio);
    let captured = background::run(py, None, move |_| capture(&problem, &signal, frames))?;
    delivered(py, &spec, captured, gain, latency)
}

/// The signal in normalised time, and its length in fast samples.
fn analog(spec: &Spec, signal: &Bound<'_, PyAny>, rate: Option<f64>) -> PyResult<(Analog, usize)> {
    if let Ok(text) = signal.cast::<PyString>() {
        let source: Source = text.to_cow()?.parse().map_err(refused)?;
        let source = source.normalised(spec.fast_period);
        let length = source.duration().unwrap_or_default().0.ceil();
        return Ok((
            Analog::Known(source),
            length.clamp(DEFAULT_SAMPLES, MOST_SAMPLES as f64 + 1.0) as usize,
        ));
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
    let length = (recording.duration() * (1.0 + 1e-12)).0.floor() as usize;
    Ok((Analog::Recorded(recording), length / spec.ratio * spec.ratio))
}

fn check_work(problem: &Problem, signal: &Analog, samples: usize) -> PyResult<()> {
    if samples == 0 || samples > MOST_SAMPLES {
        return Err(HybankError::new_err(format!(
            "samples: {samples} fast samples cannot be captured; ask for 1 to {MOST_SAMPLES}"
        )));
    }
    let Analog::Known(source) = signal else { return Ok(()) };
    let span = FastPeriods(samples as f64);
    let work =
        problem.front_ends.iter().map(|filter| panels(filter, source, span, false)).fold(0.0, f64::max);
    if work <= MOST_PANELS {
        return Ok(());
    }
    Err(HybankError::new_err(format!(
        "the chirp or a front end is too fast for the fast rate: it takes {work:.1e} integration steps, more than the \
         limit of {MOST_PANELS:.0e}; check the units of frequencies and fast_period, or ask for fewer samples"
    )))
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
