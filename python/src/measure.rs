//! `hybank.measure`.

use crate::arrays::{ArrayShape, Held};
use crate::background;
use crate::errors::{choose, refused, warn};
use crate::formats;
use crate::results::{Made, record};
use crate::values::frequencies;
use hybank::captures::ChannelSamples;
use hybank::io::StatedScale;
use hybank::measure::{self as quality, MeasureWarning, Measurement, Settings, Window};
use hybank::overview::{Figure, causes, column};
use hybank::units::{Decibels, Hertz};
use numpy::PyArray1;
use pyo3::prelude::*;

/// How a record is measured.
struct MeasureRequest {
    rate: Hertz,
    window: Window,
    /// Samples at either end that are not measured.
    skip: usize,
    scale: StatedScale,
}

impl MeasureRequest {
    fn new(rate: f64, window: &str, skip: usize, full_scale: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        if !(rate > 0.0 && rate.is_finite()) {
            return Err(refused(format!("rate: {rate} is no sample rate; give samples per second")));
        }
        let scale = StatedScale { given: formats::full_scale(full_scale)?, ..StatedScale::default() };
        Ok(Self { rate: Hertz(rate), window: choose("window", window, &WINDOWS)?, skip, scale })
    }

    /// The only channel of an array, without its ends.
    fn channel(&self, y: &Bound<'_, PyAny>) -> PyResult<ChannelSamples> {
        let captures = Held::new(y, ArrayShape::MONO.scaled(self.scale))?.captures()?;
        let channel = captures.channels.into_iter().next().unwrap_or_default();
        channel.trimmed(self.skip).map_err(|error| refused(format!("skip: {error}")))
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
    full_scale: Option<&Bound<'_, PyAny>>,
    window: &str,
    skip: usize,
) -> PyResult<Py<PyAny>> {
    let request = MeasureRequest::new(rate, window, skip, full_scale)?;
    let settings = Settings {
        tones: frequencies("tones", tones)?.into_iter().map(Hertz).collect(),
        converters: interleaved,
        harmonics,
        window: request.window,
        ..Settings::default()
    };
    let (channel, rate) = (request.channel(y)?, request.rate);
    let found = background::run(y.py(), None, move |_| channel.measured(rate, &settings))?;
    result(y.py(), &found.map_err(refused)?)
}

/// A record against a reference, and the spectrum of their difference: hertz and amplitudes.
#[pyfunction]
#[pyo3(signature = (y, reference, rate, window, skip, full_scale))]
pub(crate) fn compare(
    y: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    rate: f64,
    window: &str,
    skip: usize,
    full_scale: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Py<PyAny>, SpectrumArrays)> {
    let (py, request) = (y.py(), MeasureRequest::new(rate, window, skip, full_scale)?);
    let part = |x: &Bound<'_, PyAny>| -> PyResult<Vec<f64>> {
        let channel = request.channel(x)?;
        if channel.imaginary.is_some() {
            return Err(refused(
                "ref: complex samples, and only real ones are compared; give the real or the imaginary parts of both",
            ));
        }
        Ok(channel.samples)
    };
    let (own, other) = (part(y)?, part(reference)?);
    let MeasureRequest { rate, window, .. } = request;
    let found = background::run(py, None, move |_| quality::compare(&own, &other, rate, window))?;
    let found = found.map_err(refused)?;
    Ok((record(py, &found)?, spectrum(py, &found.error_spectrum, 1.0)))
}

/// Hertz, and levels in dB.
type SpectrumArrays = (Py<PyArray1<f64>>, Py<PyArray1<f64>>);

fn spectrum(py: Python<'_>, of: &quality::RecordSpectrum, full_scale: f64) -> SpectrumArrays {
    let hertz = (0..of.amplitudes.len()).map(|bin| of.frequency(bin).0);
    let levels = of.amplitudes.iter().map(|amplitude| Decibels::of_amplitude(amplitude / full_scale).0);
    (PyArray1::from_iter(py, hertz).unbind(), PyArray1::from_iter(py, levels).unbind())
}

/// The windows by name.
const WINDOWS: [(&str, Window); 4] =
    [("none", Window::None), ("hann", Window::Hann), ("bh4", Window::Bh4), ("bh7", Window::Bh7)];

/// As the report of the command line. Figures may be infinite, which JSON cannot say.
fn result(py: Python<'_>, found: &Measurement) -> PyResult<Py<PyAny>> {
    let text = |warning: MeasureWarning| match &warning {
        MeasureWarning::Unsettled(ends) => format!("{warning}; skip={} leaves them out", ends.samples),
        _ => warning.to_string(),
    };
    let warnings: Vec<String> = found.warnings().into_iter().map(text).collect();
    warnings.iter().try_for_each(|text| warn(py, text))?;
    let spurs: Vec<_> = found.spurs.iter().map(|spur| NamedSpur { spur, cause: causes(spur) }).collect();
    let figure = |of: Figure| (of.name, of.value, of.unit, of.meaning);
    let made = Made::of(py, "Measurement", found)?
        .with("sinad_db", found.sinad.0)?
        .with("enob_from_sinad", found.enob)?
        .with("enob_full_scale", found.enob_full_scale)?
        .with("snr_db", found.snr.0)?
        .with("thd_db", found.thd.0)?
        .with("thd_straightened_db", found.thd_straightened.map(|thd| thd.0))?
        .with("interleaving_db", found.interleaving.map(|level| level.0))?
        .with("sfdr_db", found.sfdr.0)?
        .with("sfdr_without_interleaving_db", found.sfdr_without_interleaving.map(|level| level.0))?
        .with("noise_density_dbfs_per_hertz", found.noise_density.0)?
        .with("spurs", record(py, &spurs)?)?
        .with("warnings", warnings)?
        .with("figures", column(found).into_iter().map(figure).collect::<Vec<_>>())?
        .with("spectrum", spectrum(py, &found.spectrum, found.full_scale))?;
    made.object().map(Bound::unbind)
}

/// A spur with its causes as a text.
#[derive(serde::Serialize)]
struct NamedSpur<'a> {
    #[serde(flatten)]
    spur: &'a quality::Spur,
    cause: String,
}
