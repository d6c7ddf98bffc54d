//! Fuses arrays.

use crate::arrays::{Held, Shape};
use crate::errors::refused;
use crate::formats::Format;
use crate::outputs::NewArray;
use crate::results::FuseReport;
use crate::signals::Signals;
use hybank::bank::Bank;
use hybank::pipeline::{self, DroppedLatency, GapPolicy, Outcome, Settings};
use hybank::runtime::{Algorithm, Options, Plan, ThreadPool};
use numpy::PyArray1;
use pyo3::prelude::*;

/// Most threads: more than any processor has, and as many as start at once.
const MOST_THREADS: i64 = 1024;

/// How an array is to be fused.
pub(crate) struct Request {
    workers: Option<ThreadPool>,
    gaps: Option<GapPolicy>,
    algorithm: Algorithm,
    keep_latency: bool,
}

impl Request {
    pub(crate) fn new(
        threads: i64,
        gaps: Option<&str>,
        algorithm: &str,
        keep_latency: bool,
    ) -> PyResult<Self> {
        let gaps = match gaps {
            None => None,
            Some("hold") => Some(GapPolicy::Hold),
            Some("zero") => Some(GapPolicy::Zero),
            Some(other) => {
                return Err(refused(format!("gaps: \"{other}\" is unknown; choose \"hold\" or \"zero\"")));
            }
        };
        Ok(Self { workers: workers(threads)?, gaps, algorithm: parse_algorithm(algorithm)?, keep_latency })
    }

    fn settings(&self) -> Settings<'_> {
        let dropped = if self.keep_latency { DroppedLatency::Added } else { DroppedLatency::All };
        Settings { dropped, gaps: self.gaps, workers: self.workers.as_ref(), ..Settings::default() }
    }
}

/// The threads beside the caller's; `None` for a single one.
fn workers(threads: i64) -> PyResult<Option<ThreadPool>> {
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
    let options = Options { precision: format.number.precision(), algorithm, ..Options::default() };
    bank.plan(settings.options(options)).map_err(refused)
}

/// The output samples of an array, with the report.
pub(crate) fn fuse<'py>(
    bank: &Bank,
    x: &Bound<'py, PyAny>,
    shape: Shape,
    dtype: Option<&Bound<'py, PyAny>>,
    request: &Request,
) -> PyResult<(Bound<'py, PyAny>, FuseReport)> {
    let py = x.py();
    let held = Held::new(x, shape)?;
    let format = Format::of_output(held.format, dtype)?;
    let settings = request.settings();
    let plan = plan(bank, format, request.algorithm, settings)?;
    let mut array = NewArray::new(py, held.frames() * bank.ratio, format)?;
    let (parts, mut room) = (held.parts()?, array.room()?);
    let signals = Signals::new();
    let stop = || signals.raised();
    let outcome = py.detach(|| pipeline::fuse(bank, &plan, &parts, &mut room, settings, &stop));
    let outcome = outcome.map_err(|error| signals.into_error().unwrap_or_else(|| refused(error)))?;
    let clipped = room.clipped();
    let y = array.finish()?;
    Ok((y, report(py, outcome, settings.dropped.samples(&plan), clipped)))
}

fn report(py: Python<'_>, outcome: Outcome, latency_dropped: usize, clipped: u64) -> FuseReport {
    let Outcome { plan, gaps, mask, .. } = outcome;
    FuseReport {
        algorithm: plan.algorithm.to_owned(),
        numbers: plan.numbers.to_owned(),
        isa: plan.isa,
        latency_dropped,
        clipped,
        replaced: outcome.replaced,
        state_resets: outcome.state_resets,
        missing: gaps.as_ref().map(|gaps| gaps.missing),
        gaps: gaps.map(|gaps| gaps.list.iter().map(|gap| (gap.channel, gap.first, gap.length)).collect()),
        mask: mask.map(|mask| PyArray1::from_iter(py, mask.iter().map(|&mark| mark != 0)).unbind()),
    }
}
