//! `hybank.simulate`.

use crate::arrays::{Held, Shape};
use crate::background;
use crate::errors::refused;
use crate::results::Capture;
use crate::sources;
use hybank::design::Problem;
use hybank::simulate::{Analog, Captured, ComplexSource, Recording, Source, WorkloadError, capture, frames};
use hybank::spec::Spec;
use hybank::units::{FastPeriods, Hertz};
use numpy::{Complex64, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString};

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
        return Err(refused(format!("gain: {gain} is not a finite number")));
    }
    let spec = sources::spec(source)?;
    // As the command does: the converters do not know what the spec says of the signal. Without latency the
    // target lies on the time axis of the output of `Bank.fuse`.
    let unweighted = Spec { signal: None, ..spec.clone() };
    let problem = Problem::new(&unweighted, spec.wait()).map_err(refused)?;
    let signal = Signal::new(&spec, signal, rate)?;
    let frames = signal.frames(&problem, samples).map_err(refused)?;
    let (real, imaginary) = background::run(py, None, move |_| {
        let part = |analog| capture(&problem, analog, frames);
        (part(&signal.real), signal.imaginary.as_ref().map(part))
    })?;
    delivered(py, &spec, real, imaginary, gain)
}

/// An analog signal in normalised time.
struct Signal {
    real: Analog,
    /// The imaginary part of a complex signal.
    imaginary: Option<Analog>,
}

impl Signal {
    /// From a text, or from samples at `rate`.
    fn new(spec: &Spec, signal: &Bound<'_, PyAny>, rate: Option<f64>) -> PyResult<Self> {
        if let Ok(text) = signal.cast::<PyString>() {
            let source: ComplexSource = text.to_cow()?.parse().map_err(refused)?;
            let known = |part: &Source| Analog::Known(part.normalised(spec.fast_period));
            let (real, imaginary) = source.parts();
            let imaginary = (!source.is_real()).then(|| known(&imaginary));
            return Ok(Self { real: known(&real), imaginary });
        }
        let fast = spec.fast_period.rate();
        let rate = rate.map_or(fast, Hertz);
        if !(rate.0 > 0.0 && rate.0.is_finite()) {
            return Err(refused(format!("rate: {} is no sample rate; give samples per second", rate.0)));
        }
        let held = Held::new(signal, Shape { axis: -1, channels: 1 })?;
        let part = |part| -> PyResult<Analog> {
            let samples = held.doubles(part)?;
            if let Some(n) = samples.iter().position(|x| !x.is_finite()) {
                return Err(refused(format!(
                    "sample {n} of the signal is {}; give finite samples",
                    samples[n]
                )));
            }
            Ok(Analog::Recorded(Recording::new(&samples, FastPeriods(fast / rate))))
        };
        Ok(Self { real: part(0)?, imaginary: if held.format.complex { Some(part(1)?) } else { None } })
    }

    /// The frames of `samples` fast samples, or of the longer part.
    fn frames(&self, problem: &Problem, samples: Option<usize>) -> Result<usize, WorkloadError> {
        let parts = || std::iter::once(&self.real).chain(&self.imaginary);
        let usual = || parts().map(|part| part.usual_samples(problem.ratio)).max().unwrap_or(0);
        let samples = samples.unwrap_or_else(usual);
        parts()
            .map(|part| frames(problem, part, samples, false))
            .try_fold(0, |most, count| Ok(most.max(count?)))
    }
}

/// The samples as the converters deliver them: with the gain of the signal and the offsets of the spec.
fn delivered(
    py: Python<'_>,
    spec: &Spec,
    real: Captured,
    imaginary: Option<Captured>,
    gain: f64,
) -> PyResult<Capture> {
    let real = amplified(real, spec, gain);
    let (channels, target) = match imaginary.map(|part| amplified(part, spec, gain)) {
        None => (rows(py, real.channels)?, PyArray1::from_vec(py, real.target).into_any()),
        Some(imaginary) => {
            let rows = real.channels.iter().zip(&imaginary.channels);
            let rows: Vec<_> = rows.map(|(real, imaginary)| complex(real, imaginary)).collect();
            (
                self::rows(py, rows)?,
                PyArray1::from_vec(py, complex(&real.target, &imaginary.target)).into_any(),
            )
        }
    };
    Ok(Capture { channels: channels.unbind(), target: target.unbind() })
}

/// An array with a row for each converter; a list of arrays where these have rates of their own.
fn rows<T: numpy::Element + Clone>(py: Python<'_>, rows: Vec<Vec<T>>) -> PyResult<Bound<'_, PyAny>> {
    if rows.windows(2).all(|pair| pair[0].len() == pair[1].len()) {
        return Ok(PyArray2::from_vec2(py, &rows)?.into_any());
    }
    Ok(PyList::new(py, rows.into_iter().map(|row| PyArray1::from_vec(py, row)))?.into_any())
}

fn amplified(captured: Captured, spec: &Spec, gain: f64) -> Captured {
    let Captured { mut channels, mut target } = captured;
    for (samples, channel) in channels.iter_mut().zip(&spec.channels) {
        samples.iter_mut().for_each(|x| *x = *x * gain + channel.offset);
    }
    target.iter_mut().for_each(|x| *x *= gain);
    Captured { channels, target }
}

fn complex(real: &[f64], imaginary: &[f64]) -> Vec<Complex64> {
    real.iter().zip(imaginary).map(|(&re, &im)| Complex64::new(re, im)).collect()
}
