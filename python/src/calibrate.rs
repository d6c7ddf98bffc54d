//! `hybank.calibrate`.

use crate::arrays::{Held, framed};
use crate::background;
use crate::errors::{refused, warn};
use crate::formats;
use crate::results::{Made, record};
use crate::sources;
use crate::values::frequencies;
use hybank::calibrate::{
    self as calibration, Calibration, CalibrationSettings, CalibrationSignal, CalibrationTone,
    CalibrationWarning, ChannelEstimate, FittedValues, Fitting, applied,
};
use hybank::captures::Converters;
use hybank::runtime::Nonlinearity;
use hybank::sine_fit::{CurveKind, Estimate};
use hybank::spec::Spec;
use hybank::units::{FastPeriods, Hertz};
use numpy::PyArray1;
use pyo3::prelude::*;

/// Delays, gains and offsets of the channels from captures.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub(crate) fn calibrate<'py>(
    x: &Bound<'py, PyAny>,
    spec: &Bound<'_, PyAny>,
    tones: Option<&Bound<'_, PyAny>>,
    waveform: Option<Vec<f64>>,
    rate: Option<f64>,
    blind: bool,
    fit: Vec<String>,
    reference: Option<usize>,
    clip: Option<f64>,
    axis: isize,
    full_scale: Option<&Bound<'_, PyAny>>,
    nonlinearity: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = x.py();
    let spec = sources::spec(spec)?;
    let layout = spec.layout();
    let (frames, shape) = framed(x, &layout, axis, false)?;
    let scale = Converters::from(&spec).scale(formats::full_scale(full_scale)?);
    let held = Held::new(&frames, shape.scaled(scale))?;
    let tones = tones.map(|_| frequencies("tones", tones)).transpose()?;
    let signal = signal(&spec, tones, waveform, rate, blind)?;
    if clip.is_some_and(|level| level.is_nan() || level <= 0.0) {
        return Err(refused("clip: give a positive level"));
    }
    let records = held.captures()?.records(clip);
    let fit = FittedValues { nonlinearity: nonlinearity.map(curve_kind).transpose()?, ..fitted(&fit)? };
    let settings = CalibrationSettings { fit, reference: reference_of(&spec, reference)? };
    let nominal = spec.clone();
    let found =
        background::run(py, None, move |_| calibration::calibrate(&spec, &records, &signal, settings))?;
    result(py, &nominal, &found.map_err(refused)?)
}

/// The kind of signal, with its data.
fn signal(
    spec: &Spec,
    tones: Option<Vec<f64>>,
    waveform: Option<Vec<f64>>,
    rate: Option<f64>,
    blind: bool,
) -> PyResult<CalibrationSignal> {
    let wrong = |message: &str| Err(refused(message.to_owned()));
    match (tones, waveform, blind) {
        (tones, None, false) => {
            Ok(CalibrationSignal::Tones(tones.unwrap_or_default().into_iter().map(Hertz).collect()))
        }
        (None, Some(samples), false) => {
            let fast = spec.fast_period.rate();
            let rate = rate.unwrap_or(fast.0);
            if !(rate > 0.0 && rate.is_finite()) {
                return wrong("rate: give the sample rate of the waveform, in hertz");
            }
            Ok(CalibrationSignal::Waveform { samples, spacing: FastPeriods(fast.0 / rate) })
        }
        (None, None, true) => Ok(CalibrationSignal::Any),
        _ => wrong("give one of tones, waveform and blind: they are different kinds of captures"),
    }
}

fn fitted(names: &[String]) -> PyResult<FittedValues> {
    let value = |name: &String| {
        name.parse::<Fitting>().map_err(|error| refused(format!("fit: \"{name}\" is unknown; {error}")))
    };
    names.iter().try_fold(FittedValues::NOTHING, |fit, name| Ok(fit.with(value(name)?)))
}

/// From 0.
pub(crate) fn reference_of(spec: &Spec, given: Option<usize>) -> PyResult<usize> {
    match given {
        Some(0) => Err(refused("reference: channels count from 1")),
        Some(channel) => Ok(channel - 1),
        None => Ok(calibration::usual_reference(spec)),
    }
}

/// The coefficients of each converter, or the entries of its table.
fn values(curves: &[Nonlinearity]) -> Vec<&[f64]> {
    curves.iter().map(Nonlinearity::values).collect()
}

fn curve_kind(given: &Bound<'_, PyAny>) -> PyResult<CurveKind> {
    let order = given.extract().ok().filter(|order| (2..=32).contains(order)).map(CurveKind::Order);
    let is_table = || given.extract::<String>().is_ok_and(|text| text == "table");
    let kind = order.or_else(|| is_table().then_some(CurveKind::Table));
    kind.ok_or_else(|| refused("nonlinearity: give an order from 2 to 32, or \"table\""))
}

/// A tone that was used.
#[derive(serde::Serialize)]
struct ToneRecord {
    frequency: Estimate<Hertz>,
    zone: usize,
    amplitude: f64,
}

/// An estimate of a channel, if it was fitted.
type Of<'a> = &'a dyn Fn(&ChannelEstimate) -> Option<Estimate<f64>>;

fn result<'py>(py: Python<'py>, spec: &Spec, found: &Calibration) -> PyResult<Bound<'py, PyAny>> {
    let (calibrated, more) = applied(spec, found);
    let mut made = Made::new(py, "Calibration")?;
    let seconds = |delay: Estimate<FastPeriods>| Estimate {
        value: delay.value.in_seconds(spec.fast_period).0,
        sigma: delay.sigma.in_seconds(spec.fast_period).0,
    };
    let columns: [(&str, Of<'_>); 4] = [
        ("delay", &|channel| channel.delay.map(seconds)),
        ("gain", &|channel| channel.gain),
        ("offset", &|channel| channel.offset),
        ("cutoff", &|channel| channel.cutoff),
    ];
    for (name, of) in columns {
        let column = |part: fn(Estimate<f64>) -> f64| {
            PyArray1::from_iter(py, found.channels.iter().map(|channel| of(channel).map_or(f64::NAN, part)))
        };
        made = made.with(name, column(|found| found.value))?;
        made = made.with(&format!("{name}_sigma"), column(|found| found.sigma))?;
    }
    let tone = |tone: &CalibrationTone| ToneRecord {
        frequency: tone.frequency,
        zone: tone.zone,
        amplitude: tone.amplitude.value,
    };
    let tones: Vec<ToneRecord> = found.tones.iter().map(tone).collect();
    let (notes, warnings): (Vec<&CalibrationWarning>, _) =
        found.warnings.iter().chain(&more).partition(|warning| warning.is_note());
    warnings.iter().try_for_each(|warning| warn(py, warning))?;
    let texts = |list: Vec<&CalibrationWarning>| list.iter().map(ToString::to_string).collect::<Vec<_>>();
    made.with("spec", calibrated.to_toml().map_err(refused)?)?
        .with("reference", found.reference + 1)?
        .with("tones", record(py, &tones)?)?
        .with("modulus_samples", found.modulus.map(|modulus| modulus.0))?
        .with("frames", found.frames)?
        .with("clipped", &found.clipped)?
        .with("misfit", found.misfit)?
        .with("nonlinearity", found.nonlinearity.as_ref().map(|curves| values(curves)))?
        .with("notes", texts(notes))?
        .with("warnings", texts(warnings))?
        .object()
}
