//! Fuses arrays.

use crate::arrays::{Held, Shape};
use crate::errors::{HybankError, refused};
use crate::formats::Format;
use crate::outputs::NewArray;
use crate::results::FuseReport;
use crate::signals::Signals;
use hybank::bank::Bank;
use hybank::pipeline::{self, GapPolicy, Whole, WholeSettings};
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
                return Err(HybankError::new_err(format!(
                    "gaps: \"{other}\" is unknown; choose \"hold\" or \"zero\""
                )));
            }
        };
        Ok(Self { workers: workers(threads)?, gaps, algorithm: parse_algorithm(algorithm)?, keep_latency })
    }

    /// As the command line chooses: the fastest, and direct where gaps are filled, so that outputs that no
    /// gap affects have the same bits as without gaps.
    fn algorithm(&self) -> Algorithm {
        if self.gaps.is_some() { self.algorithm.without_added_latency() } else { self.algorithm }
    }
}

/// The threads beside the caller's; `None` for a single one.
fn workers(threads: i64) -> PyResult<Option<ThreadPool>> {
    match usize::try_from(threads) {
        Ok(1) => Ok(None),
        Ok(count) if threads <= MOST_THREADS => Ok(Some(ThreadPool::new(count)?)),
        _ => Err(HybankError::new_err(format!(
            "threads: {threads} is not from 1 to {MOST_THREADS}, or 0 for one per processor"
        ))),
    }
}

/// The algorithm of a name.
pub(crate) fn parse_algorithm(name: &str) -> PyResult<Algorithm> {
    name.parse().map_err(|error| HybankError::new_err(format!("algorithm: {error}")))
}

/// The bank made ready for outputs of a format.
pub(crate) fn plan(bank: &Bank, format: Format, algorithm: Algorithm) -> PyResult<Plan> {
    let options = Options { precision: format.number.precision(), algorithm, ..Options::default() };
    bank.plan(options).map_err(refused)
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
    let plan = plan(bank, format, request.algorithm())?;
    let mut array = NewArray::new(py, held.frames() * bank.ratio, format)?;
    let (mut input, mut room) = (held.samples()?, array.room()?);
    let settings = WholeSettings {
        keep_latency: request.keep_latency,
        gaps: request.gaps,
        workers: request.workers.as_ref(),
    };
    let mut report = Report::default();
    for part in 0..=usize::from(format.complex) {
        input.select(part);
        room.select(part);
        let signals = Signals::new();
        let stop = || signals.raised();
        let whole = py.detach(|| pipeline::fuse_until(bank, &plan, &input, &mut room, settings, &stop));
        report.add(whole.map_err(|error| signals.into_error().unwrap_or_else(|| refused(error)))?);
    }
    report.clipped = room.clipped();
    let y = array.finish()?;
    Ok((y, report.finish(py, &plan, request.keep_latency)))
}

/// Counts of both parts of complex samples.
#[derive(Default)]
struct Report {
    whole: Whole,
    clipped: u64,
}

impl Report {
    fn add(&mut self, whole: Whole) {
        self.whole.replaced += whole.replaced;
        self.whole.state_resets += whole.state_resets;
        match (&mut self.whole.gaps, whole.gaps) {
            (Some(all), Some(gaps)) => {
                all.count += gaps.count;
                all.missing += gaps.missing;
                all.list.extend(gaps.list);
            }
            (all, gaps) => *all = gaps,
        }
        match (&mut self.whole.mask, whole.mask) {
            (Some(all), Some(mask)) => all.iter_mut().zip(mask).for_each(|(mark, other)| *mark |= other),
            (all, mask) => *all = mask,
        }
    }

    fn finish(self, py: Python<'_>, plan: &Plan, keep_latency: bool) -> FuseReport {
        let summary = plan.summary();
        let mask = self.whole.mask;
        let gaps = self.whole.gaps;
        FuseReport {
            algorithm: summary.algorithm.to_owned(),
            numbers: summary.numbers.to_owned(),
            isa: summary.isa,
            latency_dropped: if keep_latency { plan.extra_latency() } else { plan.latency() },
            clipped: self.clipped,
            replaced: self.whole.replaced,
            state_resets: self.whole.state_resets,
            missing: gaps.as_ref().map(|gaps| gaps.missing),
            gaps: gaps.map(|gaps| gaps.list.iter().map(|gap| (gap.channel, gap.first, gap.length)).collect()),
            mask: mask.map(|mask| PyArray1::from_iter(py, mask.iter().map(|&mark| mark != 0)).unbind()),
        }
    }
}
