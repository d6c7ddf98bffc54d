//! `hybank.measure`.

use crate::arrays::{Held, Shape};
use crate::background;
use crate::errors::{choose, refused};
use crate::results::{Made, record};
use crate::values::frequencies;
use hybank::measure::{self as quality, Imbalance, Measurement, Settings, Spur, Window};
use hybank::overview::{Figure, column};
use hybank::units::{Decibels, Hertz};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyComplex;

/// How a record is measured.
struct Request {
    rate: Hertz,
    window: Window,
    /// Samples at either end that are not measured.
    skip: usize,
}

impl Request {
    fn new(rate: f64, window: &str, skip: usize) -> PyResult<Self> {
        if !(rate > 0.0 && rate.is_finite()) {
            return Err(refused(format!("rate: {rate} is no sample rate; give samples per second")));
        }
        Ok(Self { rate: Hertz(rate), window: choose("window", window, &WINDOWS)?, skip })
    }

    /// One part of a record, without its ends.
    fn samples(&self, held: &Held<'_>, part: usize) -> PyResult<Vec<f64>> {
        let (skip, count) = (self.skip, held.frames());
        if 2 * skip >= count && skip > 0 {
            let most = count.div_ceil(2);
            return Err(refused(format!(
                "skip: {skip} leaves nothing of {count} samples; skip fewer than {most}"
            )));
        }
        let mut samples = held.doubles(part)?;
        samples.truncate(count - skip);
        samples.drain(..skip);
        Ok(samples)
    }
}

/// The quality of a record of one or several tones.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub(crate) fn measure<'py>(
    y: &Bound<'py, PyAny>,
    rate: f64,
    tones: Option<&Bound<'_, PyAny>>,
    interleaved: usize,
    harmonics: usize,
    full_scale: f64,
    window: &str,
    skip: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let request = Request::new(rate, window, skip)?;
    let settings = Settings {
        tones: frequencies("tones", tones)?.into_iter().map(Hertz).collect(),
        converters: interleaved,
        harmonics,
        full_scale,
        rails: (-full_scale, full_scale),
        window: request.window,
    };
    let held = Held::new(y, Shape { axis: -1, channels: 1 })?;
    let settings = Settings { rails: held.rails().unwrap_or(settings.rails), ..settings };
    let (real, rate) = (request.samples(&held, 0)?, request.rate);
    let imaginary = if held.format.complex { Some(request.samples(&held, 1)?) } else { None };
    let found = background::run(y.py(), None, move |_| match imaginary {
        Some(imaginary) => quality::measure_complex(&real, &imaginary, rate, &settings),
        None => quality::measure(&real, rate, &settings),
    })?;
    result(y.py(), found.map_err(refused)?)
}

/// A record against a reference, and the spectrum of their difference: hertz and amplitudes.
#[pyfunction]
#[pyo3(signature = (y, reference, rate, window, skip))]
pub(crate) fn compare(
    y: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    rate: f64,
    window: &str,
    skip: usize,
) -> PyResult<(Py<PyAny>, Spectrum)> {
    let (py, request) = (y.py(), Request::new(rate, window, skip)?);
    let part = |x: &Bound<'_, PyAny>| -> PyResult<Vec<f64>> {
        let held = Held::new(x, Shape { axis: -1, channels: 1 })?;
        if held.format.complex {
            return Err(refused(
                "ref: complex samples, and only real ones are compared; give the real or the imaginary parts of both",
            ));
        }
        request.samples(&held, 0)
    };
    let (own, other) = (part(y)?, part(reference)?);
    let Request { rate, window, .. } = request;
    let found = background::run(py, None, move |_| quality::compare(&own, &other, rate, window))?;
    let found = found.map_err(refused)?;
    Ok((record(py, &found)?, spectrum(py, &found.error_spectrum, 1.0)))
}

/// Hertz, and levels in dB.
type Spectrum = (Py<PyArray1<f64>>, Py<PyArray1<f64>>);

fn spectrum(py: Python<'_>, of: &quality::Spectrum, full_scale: f64) -> Spectrum {
    let hertz = (0..of.amplitudes.len()).map(|bin| of.frequency(bin).0);
    let levels = of.amplitudes.iter().map(|amplitude| Decibels::of_amplitude(amplitude / full_scale).0);
    (PyArray1::from_iter(py, hertz).unbind(), PyArray1::from_iter(py, levels).unbind())
}

/// The windows by name.
const WINDOWS: [(&str, Window); 4] =
    [("none", Window::None), ("hann", Window::Hann), ("bh4", Window::Bh4), ("bh7", Window::Bh7)];

fn result(py: Python<'_>, found: Measurement) -> PyResult<Bound<'_, PyAny>> {
    let tone = |tone: &quality::Tone| (tone.frequency.value.0, tone.amplitude.value, tone.phase.value.0);
    let spur = |spur: &Spur| {
        let causes: Vec<String> = spur.causes.iter().map(ToString::to_string).collect();
        (spur.frequency.0, spur.level.0, causes.join("; "))
    };
    let imbalance = |found: &Imbalance| (found.gain.value, found.phase.value.0, found.image_rejection.0);
    let imbalances = found.quadrature.as_ref().map(|parts| parts.imbalances.iter().map(imbalance));
    let figure = |of: Figure| (of.name, of.value, of.unit, of.meaning);
    Made::new(py, "Measurement")?
        .with("sinad", found.sinad.0)?
        .with("enob", found.enob)?
        .with("enob_full_scale", found.enob_full_scale)?
        .with("snr", found.snr.0)?
        .with("thd", found.thd.0)?
        .with("interleaving", found.interleaving.map(|level| level.0))?
        .with("sfdr", found.sfdr.0)?
        .with("noise_density", found.noise_density.0)?
        .with("offset", offset(py, &found)?)?
        .with("tones", found.tones.iter().map(tone).collect::<Vec<_>>())?
        .with("spurs", found.spurs.iter().map(spur).collect::<Vec<_>>())?
        .with("imbalances", imbalances.map(Iterator::collect::<Vec<_>>))?
        .with("clipped", found.clipped)?
        .with("left_out", found.left_out)?
        .with("figures", column(&found).into_iter().map(figure).collect::<Vec<_>>())?
        .with("spectrum", spectrum(py, &found.spectrum, found.full_scale))?
        .object()
}

/// A float, or a complex number for complex samples.
fn offset(py: Python<'_>, found: &Measurement) -> PyResult<Py<PyAny>> {
    let real = found.offset.value;
    Ok(match &found.quadrature {
        Some(parts) => PyComplex::from_doubles(py, real, parts.offset.value).into_any().unbind(),
        None => real.into_pyobject(py)?.into_any().unbind(),
    })
}
