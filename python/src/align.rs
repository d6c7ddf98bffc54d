//! `hybank.align`.

use crate::arrays::{Held, Shape};
use crate::background;
use crate::calibrate::{records, reference_of};
use crate::errors::refused;
use crate::results::Made;
use crate::sources;
use hybank::figures::Alone;
use hybank::track::{self, AlignSettings, AlignedChannel, Alignment};
use hybank::units::Seconds;
use numpy::PyArray1;
use pyo3::prelude::*;

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
pub(crate) fn align<'py>(
    x: Vec<Bound<'py, PyAny>>,
    spec: &Bound<'py, PyAny>,
    reference: Option<usize>,
    within: Option<f64>,
) -> PyResult<Bound<'py, PyAny>> {
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
        rate_walk: track::RATE_WALK,
    };
    let found = background::run(py, None, move |_| {
        let found = track::align(&spec, &all, settings).map_err(|error| error.to_string())?;
        let alone = Alone::new(&found.spec).map_err(|error| error.to_string())?;
        Ok::<_, String>((found, alone))
    })?;
    let (found, alone) = found.map_err(refused)?;
    result(py, &found, alone)
}

fn result<'py>(py: Python<'py>, found: &Alignment, alone: Alone) -> PyResult<Bound<'py, PyAny>> {
    let column = |of: fn(&AlignedChannel) -> f64| PyArray1::from_iter(py, found.channels.iter().map(of));
    let lines = found.readings.iter().map(|reading| reading.line() + "\n");
    Made::new(py, "Alignment")?
        .with("spec", found.spec.to_toml().map_err(refused)?)?
        .with("skip", found.channels.iter().map(|channel| channel.skip).collect::<Vec<_>>())?
        .with("frames", found.frames)?
        .with("delay", column(|channel| channel.delay.value.0))?
        .with("drift_ppm", column(|channel| 1e6 * channel.drift.value))?
        .with("gain", column(|channel| channel.gain.value))?
        .with("offset", column(|channel| channel.offset.value))?
        .with("track", lines.collect::<String>())?
        .with("alone_db", alone.snr_db.0)?
        .with("together_db", alone.together_db.0)?
        .with("one_suffices", alone.suffices())?
        .with("warnings", found.warnings.iter().map(ToString::to_string).collect::<Vec<_>>())?
        .object()
}
