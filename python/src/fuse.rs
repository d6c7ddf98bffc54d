//! Fuses arrays.

use crate::arrays::{ArrayShape, Held, odd_of};
use crate::background::{self, SignalCheck};
use crate::errors::{capture_error, refused, warn};
use crate::formats::ArrayFormat;
use crate::outputs::NewArray;
use crate::results::Made;
use hybank::bank::Bank;
use hybank::calibrate::{Agreement, Record, Verdict, agreement, comparable, frames_for_agreement};
use hybank::design::MissingSamples;
use hybank::io::{DecodedFrames, OfflineSamples};
use hybank::pipeline::{self, DroppedLatency, Gap, GapEstimator, GapSummary, Outcome, Settings, Warning};
use hybank::runtime::{Algorithm, FrameSource, Frames, Options, Plan, Precision, ThreadPool};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Most threads: more than any processor has, and as many as start at once.
const MOST_THREADS: i64 = 1024;

/// How an array is to be fused.
pub(crate) struct FuseRequest {
    pub(crate) workers: Option<ThreadPool>,
    pub(crate) gaps: Option<Arc<dyn GapEstimator>>,
    pub(crate) algorithm: Algorithm,
    pub(crate) keep_latency: bool,
    /// A report is wanted, and so is what the captures say of the spec of the bank.
    pub(crate) is_reported: bool,
}

impl FuseRequest {
    fn settings(&self) -> Settings<'_> {
        let dropped = if self.keep_latency { DroppedLatency::Added } else { DroppedLatency::All };
        Settings { dropped, gaps: self.gaps.clone(), workers: self.workers.as_ref() }
    }
}

/// What estimates the missing samples of a bank's converters, if that is wanted.
pub(crate) fn gaps(py: Python<'_>, bank: &Bank, are_wanted: bool) -> PyResult<Option<Arc<dyn GapEstimator>>> {
    if !are_wanted {
        return Ok(None);
    }
    let estimator =
        py.detach(|| MissingSamples::of_bank(bank)).map_err(|error| refused(format!("gaps: {error}")))?;
    Ok(Some(Arc::new(estimator)))
}

/// The threads beside the caller's; `None` for a single one.
pub(crate) fn workers(threads: i64) -> PyResult<Option<ThreadPool>> {
    match usize::try_from(threads) {
        Ok(1) => Ok(None),
        Ok(count) if threads <= MOST_THREADS => Ok(Some(ThreadPool::new(count)?)),
        _ => Err(refused(format!(
            "threads: {threads} is not from 1 to {MOST_THREADS}, or 0 for one per processor"
        ))),
    }
}

/// The algorithm of a name.
pub(crate) fn parse_algorithm(name: &str) -> PyResult<Algorithm> {
    name.parse().map_err(|error| refused(format!("algorithm: {error}")))
}

/// The bank made ready for outputs of a format.
pub(crate) fn plan(bank: &Bank, format: ArrayFormat, algorithm: Algorithm) -> PyResult<Plan> {
    let options = Options { precision: Precision::of(format.number), algorithm, ..Options::default() };
    bank.plan(options).map_err(refused)
}

/// What captures say of the spec of a bank.
fn judged(bank: &Bank, held: &Held<'_>) -> PyResult<Agreement> {
    let spec = match comparable(bank.spec.as_ref(), !held.format.complex) {
        Ok(spec) => spec.clone(),
        Err(verdict) => return Ok(verdict.into()),
    };
    let most = frames_for_agreement(spec.channels.len());
    let first = held.first(most)?;
    let frames: Vec<_> = first.iter().map(DecodedFrames::frames).collect();
    let samples = OfflineSamples::of_frames(&frames, most);
    let channels = samples.map_err(|error| capture_error(error.into()))?.channels;
    let records: Vec<Record> = channels.into_iter().map(Record::new).collect();
    background::run(held.py(), None, move |_| agreement(&spec, &records))
}

/// Output samples, and how they came about.
pub(crate) struct FusedArray<'py> {
    pub(crate) y: Bound<'py, PyAny>,
    outcome: Outcome,
    captures: Agreement,
    frames: usize,
    latency_dropped: usize,
    seconds: f64,
    peak: f64,
    /// What is odd about the samples of the input.
    odd: Vec<String>,
    is_clipped: bool,
}

/// The output samples of an array.
pub(crate) fn fuse<'py>(
    bank: &Bank,
    x: &Bound<'py, PyAny>,
    shape: ArrayShape,
    dtype: Option<&Bound<'py, PyAny>>,
    request: &FuseRequest,
) -> PyResult<FusedArray<'py>> {
    let (py, begin) = (x.py(), Instant::now());
    let held = Held::new(x, shape)?;
    let format = ArrayFormat::of_output(held.format, dtype)?;
    let mut fused = filtered(bank, &held, format, request)?;
    fused.seconds = begin.elapsed().as_secs_f64();
    if request.is_reported {
        fused.captures = judged(bank, &held)?;
    }
    fused.warnings().iter().try_for_each(|text| warn(py, text))?;
    Ok(fused)
}

fn filtered<'py>(
    bank: &Bank,
    held: &Held<'py>,
    format: ArrayFormat,
    request: &FuseRequest,
) -> PyResult<FusedArray<'py>> {
    let (py, settings, frames) = (held.py(), request.settings(), held.frames());
    let asked = request.algorithm;
    let algorithm = if settings.gaps.is_some() { asked.without_added_latency() } else { asked };
    let plan = plan(bank, format, algorithm)?;
    let latency_dropped = settings.dropped.samples(&plan);
    let mut array = NewArray::new(py, frames * bank.ratio, format)?;
    let mut decoders = held.decoders()?;
    let samples = held.samples(&mut decoders)?;
    let (parts, mut room) = (samples.parts(), array.room()?);
    let parts: Vec<_> = parts.iter().map(|part| Frames::new(&**part, 0..frames)).collect();
    let parts: Vec<&dyn FrameSource> = parts.iter().map(|part| part as _).collect();
    let signals = SignalCheck::new();
    let stop = || signals.raised();
    let outcome = py.detach(|| pipeline::fuse(bank, &plan, &parts, &mut room, settings, &stop));
    let outcome = outcome.map_err(|error| signals.into_error().unwrap_or_else(|| refused(error)))?;
    Ok(FusedArray {
        // A frame may hold several samples of a converter.
        outcome: Outcome { clipped: room.clipped, channels: bank.channel_count(), ..outcome },
        peak: room.peak(frames * bank.ratio * parts.len()),
        odd: odd_of(&decoders),
        is_clipped: decoders.iter().any(|decoder| decoder.faults().any(|fault| fault.is_clipping())),
        y: array.finish()?,
        captures: Verdict::Unjudged.into(),
        frames,
        latency_dropped,
        seconds: 0.0,
    })
}

impl FusedArray<'_> {
    /// What was tolerated.
    fn warnings(&self) -> Vec<String> {
        let text = |warning| match warning {
            Warning::Clipped(_) => format!("{warning}; a dtype of floats keeps them"),
            _ => warning.to_string(),
        };
        let of_run = self.outcome.warnings().map(text).chain(self.captures.warnings());
        self.odd.iter().cloned().chain(of_run).collect()
    }

    /// The report of a run with so many output samples per second, as that of the command line.
    pub(crate) fn report<'py>(&self, py: Python<'py>, rate: f64) -> PyResult<Bound<'py, PyAny>> {
        let Self { outcome, captures, is_clipped, frames, latency_dropped, seconds, peak, .. } = self;
        let list = |gaps: &GapSummary| -> Vec<_> { gaps.list.iter().map(gap).collect() };
        Made::of(py, "FuseReport", outcome)?
            .with("frames", *frames)?
            .with("rate", rate)?
            .with("captures", captures.summary(*is_clipped))?
            .with("latency_dropped", *latency_dropped)?
            .with("peak", *peak)?
            .with("seconds", *seconds)?
            .with("warnings", self.warnings())?
            .with("missing", outcome.gaps.as_ref().map(|gaps| gaps.missing))?
            .with("gaps", outcome.gaps.as_ref().map(list))?
            .with("mask", outcome.mask.as_ref().map(|mask| marks(py, mask)))?
            .object()
    }
}

/// A gap as (channel from 1, first sample, length, SNR in dB there).
pub(crate) fn gap(gap: &Gap) -> (usize, u64, u64, f64) {
    (gap.channel, gap.first, gap.length, gap.snr_db.0)
}

/// The marks as an array.
pub(crate) fn marks(py: Python<'_>, mask: &[u8]) -> Py<PyArray1<u8>> {
    PyArray1::from_slice(py, mask).unbind()
}
