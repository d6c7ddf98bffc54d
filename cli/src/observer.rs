//! The observer of a run: reports what happens while it happens, as lines on standard error and as JSON
//! lines in the file of `--report`, and checks the captures.

use super::capture_check::{CaptureCheck, Checked};
use super::event::{Event, Events, Span};
use super::print::{Failure, failed, is_dash, say_line};
use hybank::bank::Bank;
use hybank::io::{PcmFrames, StallWatch};
use hybank::pipeline::{Gap, Pipeline};
use hybank::runtime::Input;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Least time between two looks at what happens often, so that a line of each kind counts what it leaves
/// out.
const INTERVAL: Duration = Duration::from_secs(1);
/// Time after which an input that gives nothing is reported.
const PATIENCE: Duration = Duration::from_secs(1);
/// Samples of a gap that is reported before it ends: a second, and no fewer than these.
const LONG_GAP: f64 = 1000.0;

/// The option of the commands that fuse.
#[derive(Debug, clap::Args)]
pub(super) struct ObserverArgs {
    /// Write what happens as JSON lines while it happens: gaps, clipping, stalls, warnings, and the report
    /// at the end as the last line. A FIFO will do; `-` is standard output
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

impl ObserverArgs {
    /// The file of the report.
    pub(super) fn report(&self) -> Option<&Path> {
        self.report.as_deref()
    }

    /// Refuses two uses of standard output: `samples`, the report, and, if it `prints`, the result.
    pub(super) fn check(&self, samples: &Path, prints: bool) -> Result<(), Failure> {
        let message = match self.report() {
            Some(report) if is_dash(report) && is_dash(samples) => {
                "--report - needs --output: standard output carries the samples"
            }
            Some(report) if is_dash(report) && prints => {
                "--report - and --json or --measure both want standard output; give the report a file"
            }
            _ => return Ok(()),
        };
        Err(Failure::Usage(message.into()))
    }

    /// Begins to observe a run of a bank. In a `live` run standard error has what happens at once.
    pub(super) fn begin(&self, bank: &Bank, force: bool, live: bool) -> Result<RunObserver, Failure> {
        let counts = Counts::default();
        Ok(RunObserver {
            events: Events::begin(self.report(), force)?,
            check: None,
            is_live: live,
            written: counts,
            said: counts,
            due: Instant::now(),
            long_gap: (1.0 / bank.slow_period().0).max(LONG_GAP) as u64,
            long_gaps: BTreeSet::new(),
        })
    }
}

/// Observes a run.
pub(super) struct RunObserver {
    events: Events,
    check: Option<CaptureCheck>,
    is_live: bool,
    /// What the report has, and what standard error has.
    written: Counts,
    said: Counts,
    /// When standard error may have the next lines of what happens often.
    due: Instant,
    /// Samples of a long gap, and those that were reported before their ends.
    long_gap: u64,
    long_gaps: BTreeSet<[u64; 2]>,
}

/// What has happened by a moment of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Counts {
    frames: u64,
    samples: u64,
    gaps: usize,
    replaced: u64,
    clipped: u64,
}

impl Counts {
    /// What was replaced and clipped until `later`.
    fn spans(&self, later: &Self) -> impl Iterator<Item = Event> {
        let replaced = span(self.frames, later.frames, later.replaced - self.replaced).map(Event::Replaced);
        let clipped = span(self.samples, later.samples, later.clipped - self.clipped).map(Event::Clipped);
        replaced.into_iter().chain(clipped)
    }
}

/// So many samples from `begin` to before `end`, if there are any.
fn span(begin: u64, end: u64, samples: u64) -> Option<Span> {
    (samples > 0).then(|| Span { first: begin, last: end.saturating_sub(1).max(begin), samples })
}

/// The last of some gaps, and how many there are.
fn gap_line(gaps: &[Gap]) -> Option<String> {
    let last = Event::Gap(*gaps.last()?);
    let missing: u64 = gaps.iter().map(|gap| gap.length).sum();
    Some(match gaps.len() {
        1 => last.to_string(),
        count => format!("{last}; {count} gaps with {missing} samples since the last line"),
    })
}

impl RunObserver {
    /// Where other threads report events.
    pub(super) fn events(&self) -> Events {
        self.events.clone()
    }

    /// Where the readers report inputs that give nothing.
    pub(super) fn stall_watch(&self) -> StallWatch {
        let events = self.events();
        StallWatch { patience: PATIENCE, report: Arc::new(move |stall| events.tell(&stall.into())) }
    }

    /// From now on the captures are compared with the spec of the bank, if they are `comparable`. In a live
    /// run the warnings come as soon as they are known.
    pub(super) fn check_captures(&mut self, bank: &Bank, comparable: bool) {
        self.check = Some(CaptureCheck::new(bank, comparable, self.is_live.then(|| self.events())));
    }

    /// What the comparison found.
    pub(super) fn checked(&mut self) -> Checked {
        self.check.take().map_or_else(Checked::default, CaptureCheck::finish)
    }

    /// Reports what happened since the last call, with the frames of this step.
    pub(super) fn step(&mut self, recordings: &[PcmFrames<'_>], pipeline: &Pipeline<'_>) {
        if let Some(check) = &mut self.check {
            check.observe(recordings);
        }
        let now = Counts {
            frames: self.written.frames + recordings.frames() as u64,
            samples: pipeline.samples(),
            gaps: pipeline.gaps().len(),
            replaced: pipeline.replaced(),
            clipped: pipeline.clipped(),
        };
        pipeline.gaps()[self.written.gaps..].iter().for_each(|&gap| self.events.write(&Event::Gap(gap)));
        self.written.spans(&now).for_each(|event| self.events.write(&event));
        self.written = now;
        self.report_long_gaps(pipeline);
        if self.is_live && Instant::now() >= self.due {
            self.say(pipeline.gaps());
        }
    }

    /// Says what has happened since the last time.
    fn say(&mut self, gaps: &[Gap]) {
        let gap = gap_line(&gaps[self.said.gaps..]);
        let spans = self.said.spans(&self.written).map(|event| event.to_string());
        for line in gap.into_iter().chain(spans) {
            say_line(&line);
            self.due = Instant::now() + INTERVAL;
        }
        self.said = self.written;
    }

    fn report_long_gaps(&mut self, pipeline: &Pipeline<'_>) {
        for gap in pipeline.open_gaps().filter(|gap| gap.length >= self.long_gap) {
            if self.long_gaps.insert([gap.channel as u64, gap.first]) {
                self.events.tell(&Event::GapGoesOn(gap));
            }
        }
    }

    /// Whether standard error had gaps before the end of the run.
    pub(super) fn has_said_gaps(&self) -> bool {
        self.said.gaps > 0 || !self.long_gaps.is_empty()
    }

    /// Ends the report with the summary of the run.
    pub(super) fn end(&mut self, summary: &impl serde::Serialize) -> Result<(), Failure> {
        let mut last = serde_json::json!({ "event": "summary" });
        let summary = serde_json::to_value(summary).map_err(failed)?;
        if let (Some(last), serde_json::Value::Object(summary)) = (last.as_object_mut(), summary) {
            last.extend(summary);
        }
        self.events.write(&last);
        self.events.check()
    }

    /// Ends the report of a run that failed.
    pub(super) fn fail(&mut self, failure: &Failure) {
        if let Failure::Input(message) | Failure::Usage(message) = failure {
            self.events.write(&serde_json::json!({ "event": "error", "message": message }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_counts_what_happened_since_the_one_before() {
        let before = Counts { frames: 10, samples: 20, gaps: 1, replaced: 3, clipped: 0 };
        assert_eq!(before.spans(&before).count(), 0);
        let later = Counts { frames: 15, samples: 30, gaps: 1, replaced: 5, clipped: 4 };
        let spans: Vec<String> = before.spans(&later).map(|event| event.to_string()).collect();
        assert_eq!(
            spans,
            [
                "not finite: 2 input samples of frames 10 to 14 became 0",
                "clipped: 4 of the output samples 20 to 29"
            ]
        );
    }

    #[test]
    fn one_line_names_the_last_gap_and_counts_the_others() {
        let gap = |first| Gap { channel: 2, first, length: 10 };
        assert_eq!(gap_line(&[]), None);
        assert_eq!(gap_line(&[gap(5)]).unwrap(), "gap: channel 2, sample 5, 10 missing");
        let line = gap_line(&[gap(5), gap(50)]).unwrap();
        assert_eq!(line, "gap: channel 2, sample 50, 10 missing; 2 gaps with 20 samples since the last line");
    }
}
