//! `hybank.measure`.

use crate::arrays::{Held, Shape};
use crate::background;
use crate::errors::{choose, refused};
use crate::results::record;
use crate::values::frequencies;
use hybank::measure::{self as quality, Imbalance, Settings, Window};
use hybank::overview::{Figure, column};
use hybank::units::{Decibels, Hertz};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyComplex;

/// The figures of a converter from the record of a tone.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Measurement {
    /// Signal over everything else but the constant, in dB.
    sinad: f64,
    /// Effective number of bits, of this tone and of one of full scale.
    enob: f64,
    enob_full_scale: f64,
    /// Signal over what no line explains, harmonics over signal, interleaving spurs over signal, in dB.
    snr: f64,
    thd: f64,
    /// None for a single converter.
    interleaving: Option<f64>,
    /// Largest tone over largest line, in dB.
    sfdr: f64,
    /// Noise per hertz relative to a sine of full scale, in dB.
    noise_density: f64,
    /// The constant part; of complex samples that of the real and of the imaginary parts.
    offset: Py<PyAny>,
    /// Tones: frequency in hertz, amplitude, phase in radians at the first sample.
    tones: Vec<(f64, f64, f64)>,
    /// Lines beside the tones, largest first: frequency in hertz, level in dB relative to the largest tone,
    /// causes.
    spurs: Vec<(f64, f64, String)>,
    /// Of complex samples, per tone: gain of the imaginary part relative to the real one, error of their
    /// quadrature in radians, and image rejection in dB. None for real samples.
    imbalances: Option<Vec<(f64, f64, f64)>>,
    /// Samples at the rails, and samples that are not finite.
    clipped: usize,
    left_out: usize,
    /// The figures as a report shows them: name, value, unit, meaning.
    figures: Vec<(String, String, String, String)>,
    /// The spectrum: hertz, and dB relative to full scale.
    spectrum: (Py<PyArray1<f64>>, Py<PyArray1<f64>>),
}

#[pymethods]
impl Measurement {
    fn __repr__(&self) -> String {
        format!(
            "Measurement(sinad={:.2}, enob={:.2}, snr={:.2}, thd={:.2}, sfdr={:.2})",
            self.sinad, self.enob, self.snr, self.thd, self.sfdr
        )
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("hybank._show")?.call_method1("measured", (slf,))
    }

    #[doc = include_str!("docs/Measurement.plot.rst")]
    #[pyo3(signature = (ax = None))]
    fn plot<'py>(slf: &Bound<'py, Self>, ax: Option<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("hybank._show")?.call_method1("spectrum", (slf, ax))
    }
}

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
pub(crate) fn measure(
    y: &Bound<'_, PyAny>,
    rate: f64,
    tones: Option<&Bound<'_, PyAny>>,
    interleaved: usize,
    harmonics: usize,
    full_scale: f64,
    window: &str,
    skip: usize,
) -> PyResult<Measurement> {
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

fn result(py: Python<'_>, found: quality::Measurement) -> PyResult<Measurement> {
    let decibels = |value: Decibels| value.0;
    let spur = |spur: &quality::Spur| {
        let causes: Vec<String> = spur.causes.iter().map(ToString::to_string).collect();
        (spur.frequency.0, spur.level.0, causes.join("; "))
    };
    let figure = |of: Figure| (of.name.to_owned(), of.value, of.unit.to_owned(), of.meaning);
    Ok(Measurement {
        sinad: found.sinad.0,
        enob: found.enob,
        enob_full_scale: found.enob_full_scale,
        snr: found.snr.0,
        thd: found.thd.0,
        interleaving: found.interleaving.map(decibels),
        sfdr: found.sfdr.0,
        noise_density: found.noise_density.0,
        offset: offset(py, &found)?,
        tones: found
            .tones
            .iter()
            .map(|tone| (tone.frequency.value.0, tone.amplitude.value, tone.phase.value.0))
            .collect(),
        spurs: found.spurs.iter().map(spur).collect(),
        imbalances: found.quadrature.as_ref().map(|parts| parts.imbalances.iter().map(imbalance).collect()),
        clipped: found.clipped,
        left_out: found.left_out,
        figures: column(&found).into_iter().map(figure).collect(),
        spectrum: spectrum(py, &found.spectrum, found.full_scale),
    })
}

/// A float, or a complex number for complex samples.
fn offset(py: Python<'_>, found: &quality::Measurement) -> PyResult<Py<PyAny>> {
    let real = found.offset.value;
    Ok(match &found.quadrature {
        Some(parts) => PyComplex::from_doubles(py, real, parts.offset.value).into_any().unbind(),
        None => real.into_pyobject(py)?.into_any().unbind(),
    })
}

fn imbalance(found: &Imbalance) -> (f64, f64, f64) {
    (found.gain.value, found.phase.value.0, found.image_rejection.0)
}
