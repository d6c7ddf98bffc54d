//! `hybank.calibrate`.

use crate::arrays::{Held, framed};
use crate::background;
use crate::errors::refused;
use crate::sources;
use crate::values::frequencies;
use hybank::calibrate::{
    self as calibration, CalibrationSignal, ChannelEstimate, Fit, Fitting, Record, Settings, applied,
};
use hybank::sine_fit::Estimate;
use hybank::spec::Spec;
use hybank::units::{FastPeriods, Hertz};
use numpy::PyArray1;
use pyo3::prelude::*;

/// What a calibration found. Arrays have one value per channel; it is NaN where the spec's value stands.
/// `.._sigma` are standard deviations.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Calibration {
    /// The spec with these values and their intervals, as TOML.
    spec: String,
    /// Seconds.
    delay: Py<PyArray1<f64>>,
    delay_sigma: Py<PyArray1<f64>>,
    gain: Py<PyArray1<f64>>,
    gain_sigma: Py<PyArray1<f64>>,
    offset: Py<PyArray1<f64>>,
    offset_sigma: Py<PyArray1<f64>>,
    /// Factors of the cut-off frequencies.
    cutoff: Py<PyArray1<f64>>,
    cutoff_sigma: Py<PyArray1<f64>>,
    /// The reference channel, from 1.
    reference: usize,
    /// Tones that were used, in hertz.
    tones: Vec<f64>,
    /// Frames that took part.
    frames: usize,
    /// Clipped samples of each channel, which were left out.
    clipped: Vec<usize>,
    /// 1 where the model fits to the noise; None if there are no degrees of freedom left.
    misfit: Option<f64>,
    /// What a reader of the values must know.
    warnings: Vec<String>,
}

#[pymethods]
impl Calibration {
    fn __repr__(&self) -> String {
        let misfit = self.misfit.map_or_else(|| "None".to_owned(), |misfit| format!("{misfit:.3}"));
        format!("<hybank.Calibration of {} channels: misfit {misfit}>", self.clipped.len())
    }
}

/// Delays, gains and offsets of the channels from captures.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of a Python function")]
pub(crate) fn calibrate(
    x: &Bound<'_, PyAny>,
    spec: &Bound<'_, PyAny>,
    tones: Option<&Bound<'_, PyAny>>,
    waveform: Option<Vec<f64>>,
    rate: Option<f64>,
    blind: bool,
    fit: Vec<String>,
    reference: Option<usize>,
    clip: Option<f64>,
    axis: isize,
) -> PyResult<Calibration> {
    let py = x.py();
    let spec = sources::spec(spec)?;
    let layout = spec.layout();
    let (frames, shape) = framed(x, &layout, axis, false)?;
    let held = Held::new(&frames, shape)?;
    let tones = tones.map(|_| frequencies("tones", tones)).transpose()?;
    let signal = Signal::new(&spec, tones, waveform, rate, blind)?;
    signal.check(held.format.complex)?;
    let mut records = records(&held, layout.count(), clip)?;
    if !layout.is_plain() {
        records = layout.ranges().into_iter().map(|samples| Record::in_a_row(&records[samples])).collect();
    }
    let settings = Settings { fit: fitted(&fit)?, reference: reference_of(&spec, reference)? };
    let nominal = spec.clone();
    let found = background::run(py, None, move |_| {
        calibration::calibrate(&spec, &records, signal.borrowed(), settings)
    })?;
    result(py, &nominal, &found.map_err(refused)?)
}

/// The kind of signal, with its data.
enum Signal {
    Tones(Vec<Hertz>),
    Waveform { samples: Vec<f64>, spacing: FastPeriods },
    Any,
}

impl Signal {
    fn new(
        spec: &Spec,
        tones: Option<Vec<f64>>,
        waveform: Option<Vec<f64>>,
        rate: Option<f64>,
        blind: bool,
    ) -> PyResult<Self> {
        let wrong = |message: &str| Err(refused(message.to_owned()));
        match (tones, waveform, blind) {
            (tones, None, false) => {
                Ok(Self::Tones(tones.unwrap_or_default().into_iter().map(Hertz).collect()))
            }
            (None, Some(samples), false) => {
                let fast = spec.fast_period.rate();
                let rate = rate.unwrap_or(fast.0);
                if !(rate > 0.0 && rate.is_finite()) {
                    return wrong("rate: give the sample rate of the waveform, in hertz");
                }
                Ok(Self::Waveform { samples, spacing: FastPeriods(fast.0 / rate) })
            }
            (None, None, true) => Ok(Self::Any),
            _ => wrong("give one of tones, waveform and blind: they are different kinds of captures"),
        }
    }

    /// Refuses what real samples, or complex ones, cannot hold.
    fn check(&self, is_complex: bool) -> PyResult<()> {
        let refuse = |message| Err(refused(message));
        let is_frequency = |tone: &Hertz| tone.0.is_finite() && (tone.0 > 0.0 || is_complex && tone.0 < 0.0);
        match self {
            Self::Tones(tones) if tones.iter().all(is_frequency) => Ok(()),
            Self::Tones(_) if is_complex => refuse("tones: frequencies are finite and not 0, in hertz"),
            Self::Tones(_) => refuse("tones: frequencies of real samples are positive numbers, in hertz"),
            _ if is_complex => refuse(
                "complex samples are calibrated by tones; for waveform and blind give the real or the imaginary parts",
            ),
            _ => Ok(()),
        }
    }

    fn borrowed(&self) -> CalibrationSignal<'_> {
        match self {
            Self::Tones(tones) => CalibrationSignal::Tones(tones),
            Self::Waveform { samples, spacing } => CalibrationSignal::Waveform { samples, spacing: *spacing },
            Self::Any => CalibrationSignal::Any,
        }
    }
}

/// One record per channel. Integers clip at the ends of their range, floats where `clip` says.
pub(crate) fn records(held: &Held<'_>, channels: usize, clip: Option<f64>) -> PyResult<Vec<Record>> {
    if clip.is_some_and(|level| level.is_nan() || level <= 0.0) {
        return Err(refused("clip: give a positive level"));
    }
    let unbounded = (f64::NEG_INFINITY, f64::INFINITY);
    let (lowest, highest) = clip.map(|level| (-level, level)).or(held.rails()).unwrap_or(unbounded);
    let part = |part| -> PyResult<Vec<Record>> {
        let frames = held.doubles(part)?;
        let channel = |i| frames.iter().skip(i).step_by(channels).copied().collect();
        Ok((0..channels).map(|i| Record::within(channel(i), lowest, highest)).collect())
    };
    if !held.format.complex {
        return part(0);
    }
    Ok(part(0)?.into_iter().zip(part(1)?).map(|(real, imaginary)| Record::complex(real, imaginary)).collect())
}

fn fitted(names: &[String]) -> PyResult<Fit> {
    let value = |name: &String| {
        name.parse::<Fitting>().map_err(|error| refused(format!("fit: \"{name}\" is unknown; {error}")))
    };
    names.iter().try_fold(Fit::NOTHING, |fit, name| Ok(fit.with(value(name)?)))
}

/// From 0.
pub(crate) fn reference_of(spec: &Spec, given: Option<usize>) -> PyResult<usize> {
    match given {
        Some(0) => Err(refused("reference: channels count from 1")),
        Some(channel) => Ok(channel - 1),
        None => Ok(spec.uncertainty.as_ref().and_then(|table| table.reference_channel()).unwrap_or(0)),
    }
}

fn result(py: Python<'_>, spec: &Spec, found: &calibration::Calibration) -> PyResult<Calibration> {
    let (calibrated, more) = applied(spec, found);
    let columns = |of: &dyn Fn(&ChannelEstimate) -> Option<Estimate<f64>>| {
        let (values, sigmas): (Vec<f64>, Vec<f64>) = found
            .channels
            .iter()
            .map(|channel| of(channel).map_or((f64::NAN, f64::NAN), |found| (found.value, found.sigma)))
            .unzip();
        (PyArray1::from_vec(py, values).unbind(), PyArray1::from_vec(py, sigmas).unbind())
    };
    let seconds = |delay: Estimate<FastPeriods>| Estimate {
        value: delay.value.in_seconds(spec.fast_period).0,
        sigma: delay.sigma.in_seconds(spec.fast_period).0,
    };
    let (delay, delay_sigma) = columns(&|channel| channel.delay.map(seconds));
    let (gain, gain_sigma) = columns(&|channel| channel.gain);
    let (offset, offset_sigma) = columns(&|channel| channel.offset);
    let (cutoff, cutoff_sigma) = columns(&|channel| channel.cutoff);
    Ok(Calibration {
        spec: calibrated.to_toml().map_err(refused)?,
        delay,
        delay_sigma,
        gain,
        gain_sigma,
        offset,
        offset_sigma,
        cutoff,
        cutoff_sigma,
        reference: found.reference + 1,
        tones: found.tones.iter().map(|tone| tone.frequency.value.0).collect(),
        frames: found.frames,
        clipped: found.clipped.clone(),
        misfit: found.misfit,
        warnings: found.warnings.iter().chain(&more).map(ToString::to_string).collect(),
    })
}
