//! `hybank.align`.

use crate::arrays::{Held, Shape};
use crate::background;
use crate::calibrate::{records, reference_of};
use crate::errors::refused;
use crate::sources;
use hybank::figures::Alone;
use hybank::track::{self, AlignSettings, AlignedChannel, DriftModel};
use hybank::units::Seconds;
use numpy::PyArray1;
use pyo3::prelude::*;

/// How recordings lie in time. Arrays have one value per channel; half-widths are in the spec.
#[pyclass(frozen, get_all, module = "hybank")]
#[derive(FromPyObject)]
pub(crate) struct Alignment {
    /// The spec with these values, as TOML.
    spec: String,
    /// Samples to leave out at the beginning of each recording, and samples of each that remain.
    skip: Vec<usize>,
    frames: usize,
    /// Seconds, at the first frame.
    delay: Py<PyArray1<f64>>,
    /// By how many ppm each clock is fast.
    drift_ppm: Py<PyArray1<f64>>,
    gain: Py<PyArray1<f64>>,
    offset: Py<PyArray1<f64>>,
    /// The delays over time as JSON lines: what `hybank fuse --track` reads.
    track: String,
    /// The best channel alone and all together in dB, whatever the filters are, and whether one suffices.
    alone_db: f64,
    together_db: f64,
    one_suffices: bool,
    /// What a reader of the values must know.
    warnings: Vec<String>,
}

#[pymethods]
impl Alignment {
    fn __repr__(&self) -> String {
        format!("<hybank.Alignment of {} channels: {} frames>", self.skip.len(), self.frames)
    }
}

/// When recordings began, how their clocks drift, their polarities, gains and offsets.
///
/// Parameters
/// ----------
/// x : sequence of array_like
///     One recording per channel, of any length, of a broad sound (noise, speech, music).
/// spec : Bank, Spec, dict, str or path
///     The nominal values.
/// reference : int, optional
///     The channel whose clock is the time, from 1.
/// within : float, optional
///     How far apart the recordings began at most, in seconds.
///
/// Returns
/// -------
/// Alignment
///     The spec with these values, and the samples to leave out.
///
/// Examples
/// --------
/// >>> sound = "tones:" + ",".join(f"{100 * 1.07**k:.1f}Hz" for k in range(65))
/// >>> spec = {"fast_rate": 48e3, "ratio": 2, "target": {"filter": hb.butterworth(4, 9e3)},
/// ...         "channel": [hb.Channel(delay=25e-6), hb.Channel(delay=12.5e-6)]}
/// >>> recorded = hb.simulate(spec, sound, samples=48_000).channels
/// >>> hb.align([recorded[0][500:], recorded[1]], spec).skip
/// [0, 500]
#[pyfunction]
#[pyo3(signature = (x, spec, *, reference = None, within = None))]
pub(crate) fn align(
    x: Vec<Bound<'_, PyAny>>,
    spec: &Bound<'_, PyAny>,
    reference: Option<usize>,
    within: Option<f64>,
) -> PyResult<Alignment> {
    let py = spec.py();
    let spec = sources::spec(spec)?;
    if within.is_some_and(|time| time.is_nan() || time < 0.0) {
        return Err(refused("within: give a time in seconds, not negative"));
    }
    let mut all = Vec::new();
    for array in &x {
        all.extend(records(&Held::new(array, Shape { axis: -1, channels: 1 })?, 1, None)?);
    }
    let settings = AlignSettings {
        reference: reference_of(&spec, reference)?,
        within: within.map(Seconds),
        model: DriftModel::wandering(1e-6),
    };
    let found = background::run(py, None, move |_| {
        let found = track::align(&spec, &all, settings).map_err(|error| error.to_string())?;
        let alone = Alone::new(&found.spec).map_err(|error| error.to_string())?;
        Ok::<_, String>((found, alone))
    })?;
    let (found, alone) = found.map_err(refused)?;
    result(py, &found, alone)
}

fn result(py: Python<'_>, found: &track::Alignment, alone: Alone) -> PyResult<Alignment> {
    let column =
        |of: fn(&AlignedChannel) -> f64| PyArray1::from_iter(py, found.channels.iter().map(of)).unbind();
    Ok(Alignment {
        spec: found.spec.to_toml().map_err(refused)?,
        skip: found.channels.iter().map(|channel| channel.skip).collect(),
        frames: found.frames,
        delay: column(|channel| channel.delay.value.0),
        drift_ppm: column(|channel| 1e6 * channel.drift.value),
        gain: column(|channel| channel.gain.value),
        offset: column(|channel| channel.offset.value),
        track: found.readings.iter().map(|reading| reading.line() + "\n").collect(),
        alone_db: alone.snr_db.0,
        together_db: alone.together_db.0,
        one_suffices: alone.suffices(),
        warnings: found.warnings.iter().map(ToString::to_string).collect(),
    })
}
