//! Fuses arrays.

use crate::arrays::{Held, Shape};
use crate::background::Signals;
use crate::errors::{choose, refused};
use crate::formats::Format;
use crate::outputs::NewArray;
use crate::results::Made;
use crate::running::{Extras, Running};
use hybank::bank::Bank;
use hybank::pipeline::{self, DroppedLatency, GapPolicy, GapSummary, Outcome, PipelineError, Settings};
use hybank::runtime::{Algorithm, Frames, Options, Plan, Precision, ThreadPool};
use numpy::PyArray1;
use pyo3::prelude::*;

/// Most threads: more than any processor has, and as many as start at once.
const MOST_THREADS: i64 = 1024;

/// Frames that are filtered between two looks for signals while delays are followed.
const PIECE: usize = 1 << 16;

/// How an array is to be fused.
pub(crate) struct Request {
    pub(crate) workers: Option<ThreadPool>,
    pub(crate) extras: Extras,
    pub(crate) algorithm: Algorithm,
    pub(crate) keep_latency: bool,
}

impl Request {
    fn settings(&self) -> Settings<'_> {
        let dropped = if self.keep_latency { DroppedLatency::Added } else { DroppedLatency::All };
        Settings { dropped, workers: self.workers.as_ref(), ..self.extras.settings() }
    }
}

/// The policy of a name.
pub(crate) fn parse_gaps(gaps: Option<&str>) -> PyResult<Option<GapPolicy>> {
    let known = [("hold", GapPolicy::Hold), ("zero", GapPolicy::Zero)];
    gaps.map(|name| choose("gaps", name, &known)).transpose()
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

/// The bank made ready for outputs of a format, in a run with `settings`.
pub(crate) fn plan(
    bank: &Bank,
    format: Format,
    algorithm: Algorithm,
    settings: Settings<'_>,
) -> PyResult<Plan> {
    let options = Options { precision: Precision::of(format.number), algorithm, ..Options::default() };
    bank.plan(settings.options(options)).map_err(refused)
}

/// The output samples of an array, with the report.
pub(crate) fn fuse<'py>(
    bank: &Bank,
    x: &Bound<'py, PyAny>,
    shape: Shape,
    dtype: Option<&Bound<'py, PyAny>>,
    request: &Request,
) -> PyResult<[Bound<'py, PyAny>; 2]> {
    let py = x.py();
    let held = Held::new(x, shape)?;
    let format = Format::of_output(held.format, dtype)?;
    let settings = request.settings();
    if request.extras.follow.is_some() {
        return followed(bank, &held, format, request);
    }
    let plan = plan(bank, format, request.algorithm, settings)?;
    let mut array = NewArray::new(py, held.frames() * bank.ratio, format)?;
    let (parts, mut room) = (held.parts()?, array.room()?);
    let parts: Vec<_> = parts.iter().map(|part| Frames::new(&part[..], 0..held.frames())).collect();
    let signals = Signals::new();
    let stop = || signals.raised();
    let outcome = py.detach(|| pipeline::fuse(bank, &plan, &parts, &mut room, settings, &stop));
    let outcome = outcome.map_err(|error| signals.into_error().unwrap_or_else(|| refused(error)))?;
    let clipped = room.clipped;
    let y = array.finish()?;
    let outcome = Outcome { clipped, ..outcome };
    Ok([y, report(py, outcome, settings.dropped.samples(&plan))?.object()?])
}

/// As [`fuse`], with filters that follow the delays.
fn followed<'py>(
    bank: &Bank,
    held: &Held<'py>,
    format: Format,
    request: &Request,
) -> PyResult<[Bound<'py, PyAny>; 2]> {
    let py = held.py();
    let settings = request.settings();
    let mut running = Running::new(bank, format, request.algorithm, &request.extras, settings)?;
    let (tracks, latency_dropped) = (running.tracks(), settings.dropped.samples(running.pipeline.plan()));
    let (recordings, frames, signals) = (held.recordings()?, held.frames(), Signals::new());
    let done = py.detach(|| {
        for first in (0..frames).step_by(PIECE) {
            if signals.raised() {
                return Err(PipelineError::Stopped);
            }
            let end = frames.min(first + PIECE);
            let piece: Vec<_> = recordings.iter().map(|all| all.range(first..end)).collect();
            running.push(&piece, end - first)?;
        }
        running.flush((frames * bank.ratio) as u64)?;
        Ok((running.outputs, running.pipeline.finish()?))
    });
    let done = done.map_err(|error| signals.into_error().unwrap_or_else(|| refused(error)));
    let (outputs, outcome) = done?;
    tracks.warn(py)?;
    let y = PyArray1::from_vec(py, outputs.samples).call_method1("view", (format.name(),))?;
    let mask = outcome.gaps.is_some().then_some(outputs.mask);
    let report = report(py, Outcome { mask, ..outcome }, latency_dropped)?;
    Ok([y, report.with("track", tracks.log(py)?)?.object()?])
}

fn report(py: Python<'_>, outcome: Outcome, latency_dropped: usize) -> PyResult<Made<'_>> {
    let Outcome { plan, gaps, mask, .. } = outcome;
    let list = |gaps: GapSummary| -> Vec<_> {
        gaps.list.iter().map(|gap| (gap.channel, gap.first, gap.length)).collect()
    };
    Made::new(py, "FuseReport")?
        .with("algorithm", plan.algorithm)?
        .with("numbers", plan.numbers)?
        .with("isa", plan.isa)?
        .with("latency_dropped", latency_dropped)?
        .with("clipped", outcome.clipped)?
        .with("replaced", outcome.replaced)?
        .with("state_resets", outcome.state_resets)?
        .with("missing", gaps.as_ref().map(|gaps| gaps.missing))?
        .with("gaps", gaps.map(list))?
        .with("mask", mask.map(|mask| marks(py, &mask)))
}

/// True where a byte is not 0.
pub(crate) fn marks(py: Python<'_>, mask: &[u8]) -> Py<PyArray1<bool>> {
    PyArray1::from_iter(py, mask.iter().map(|&mark| mark != 0)).unbind()
}
