//! Code that `fuse` and `stream` share: options of the filters, the report, the end of a run.

mod carried;

use super::Failure;
use super::bank_file::is_dash;
use super::gaps::say_gaps;
use super::journal::Journal;
use super::print::print_json;
use super::say::{say, warn};
use crate::pipeline::{FileOutputs, Gap, GapSummary, Outcome, Warning};
use crate::runtime::{Algorithm, PlanSummary, ThreadPool};
pub(super) use carried::carried;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::path::Path;

/// Reads `--algorithm`.
pub(super) fn algorithms() -> impl TypedValueParser<Value = Algorithm> {
    let names = Algorithm::ALL.map(|algorithm| {
        PossibleValue::new(algorithm.name()).help(match algorithm {
            Algorithm::Auto => "The fastest algorithm that suits the command",
            Algorithm::Direct => "Computes every product; adds no latency",
            Algorithm::OverlapSave { .. } => {
                "Fourier transforms of blocks; faster for long filters, adds latency"
            }
        })
    });
    PossibleValuesParser::new(names).try_map(|name| name.parse())
}

/// Threads of the filters.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct ThreadArgs {
    /// Threads that filter (FIR banks only), 0 for one per processor. The result has the same bits with any
    /// number. More than one thread helps with many taps or channels; otherwise reading and writing take
    /// longer than filtering
    #[arg(long, value_name = "T", default_value_t = 1, value_parser = clap::value_parser!(u16).range(0..=1024))]
    threads: u16,
}

impl ThreadArgs {
    /// `None` if the calling thread does all.
    pub(super) fn workers(self) -> Result<Option<ThreadPool>, Failure> {
        if self.threads == 1 {
            return Ok(None);
        }
        let refused = |error| Failure::Input(format!("--threads {}: {error}; ask for fewer", self.threads));
        ThreadPool::new(self.threads.into()).map(Some).map_err(refused)
    }

    /// Bytes of each input that are read at a time, for `bytes` with one thread: enough for all threads.
    pub(super) fn bytes(self, bytes: usize) -> usize {
        if self.threads == 1 { bytes } else { 8 * bytes }
    }
}

/// What every command that fuses reports.
#[derive(Debug, serde::Serialize)]
pub(super) struct RunReport {
    /// How the bank ran.
    plan: PlanSummary,
    channels: usize,
    ratio: usize,
    /// Output samples written.
    pub(super) samples: u64,
    /// Output samples that saturated.
    pub(super) clipped: u64,
    /// Input samples that were NaN or infinite and became 0.
    replaced: u64,
    /// Times that a recursion's state was not finite and was set to zero.
    state_resets: u64,
    /// Missing samples, if --gaps asked for them.
    #[serde(skip_serializing_if = "Option::is_none")]
    gaps: Option<GapSummary>,
    warnings: Vec<String>,
    /// How many of the last warnings were reported during the run.
    #[serde(skip)]
    reported: usize,
}

impl RunReport {
    /// Of an outcome and what was tolerated before; `lossless` is the option that would have kept clipped
    /// samples.
    pub(super) fn new(outcome: Outcome, tolerated: Vec<Warning>, lossless: &str) -> Self {
        let text = |warning| match warning {
            Warning::Clipped(_) => format!("{warning}; {lossless} keeps them"),
            _ => warning.to_string(),
        };
        let warnings = tolerated.into_iter().chain(outcome.warnings()).map(text).collect();
        let Outcome { plan, channels, ratio, samples, clipped, replaced, state_resets, gaps } = outcome;
        Self { plan, channels, ratio, samples, clipped, replaced, state_resets, gaps, warnings, reported: 0 }
    }

    /// The gaps that were filled.
    pub(super) fn gaps(&self) -> &[Gap] {
        self.gaps.as_ref().map_or(&[], |gaps| &gaps.list)
    }

    /// With further warnings.
    pub(super) fn with_warnings(mut self, more: Vec<String>) -> Self {
        self.warnings.extend(more);
        self
    }

    /// With warnings that were reported during the run.
    pub(super) fn with_reported(mut self, reported: Vec<String>) -> Self {
        self.reported = reported.len();
        self.with_warnings(reported)
    }

    /// With `strict` the first warning is an error.
    fn judge(&self, strict: bool) -> Result<(), Failure> {
        match self.warnings.first() {
            Some(first) if strict => Err(Failure::Input(format!("{first} (an error because of --strict)"))),
            _ => Ok(()),
        }
    }
}

/// Checks the run, renames the outputs to their final names, and then prints the warnings, so that a
/// warning that cannot be written loses no output.
pub(super) fn complete(
    outputs: FileOutputs,
    run: &RunReport,
    strict: bool,
    journal: &Journal,
) -> Result<(), Failure> {
    let judged = run.judge(strict);
    if judged.is_ok() {
        outputs.finish().map_err(Failure::running)?;
    }
    let are_said = journal.quiet();
    run.gaps.iter().for_each(|gaps| say_gaps(gaps, are_said));
    judged?;
    run.warnings[..run.warnings.len() - run.reported].iter().for_each(|warning| warn(warning));
    Ok(())
}

/// The report as one JSON object: on standard output, or on standard error where samples go to standard
/// output.
pub(super) fn print_report(report: &impl serde::Serialize, samples: &Path) -> Result<(), Failure> {
    if !is_dash(samples) {
        return print_json(report);
    }
    say(&(serde_json::to_string(report).map_err(Failure::input)? + "\n"));
    Ok(())
}
