//! The observer of a run: reports what happens while it happens, as lines on standard error and as JSON
//! lines in the file of `--report`, and checks the captures.

use super::capture_check::CaptureCheck;
use super::event_file::EventFile;
use super::print::{Failure, is_dash, say_line};
use super::run::frames_of;
use hybank::bank::Bank;
use hybank::calibrate::{Agreement, Verdict};
use hybank::io::{RecordedFrames, Stall};
use hybank::pipeline::{Gap, Pipeline};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Least time between two looks at what happens often, so that a line of each kind counts what it leaves
/// out.
const INTERVAL: Duration = Duration::from_secs(1);
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
            file: EventFile::begin(self.report(), force)?,
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
    file: EventFile,
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
    fn spans(&self, later: &Self) -> impl Iterator<Item = EventSpan> {
        let span = |event, first: u64, end: u64, samples| EventSpan {
            event,
            first,
            last: end.saturating_sub(1).max(first),
            samples,
        };
        let replaced = span("replaced", self.frames, later.frames, later.replaced - self.replaced);
        let clipped = span("clipped", self.samples, later.samples, later.clipped - self.clipped);
        [replaced, clipped].into_iter().filter(|span| span.samples > 0)
    }
}

/// Some of the samples (of the output) or frames (of the input) from `first` to `last`, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
struct EventSpan {
    /// `replaced` (input samples that were NaN or infinite became 0) or `clipped` (output samples
    /// saturated).
    #[serde(skip)]
    event: &'static str,
    first: u64,
    last: u64,
    /// How many samples.
    samples: u64,
}

impl fmt::Display for EventSpan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { event, first, last, samples } = self;
        match *event {
            "replaced" => {
                write!(f, "not finite: {samples} input samples of frames {first} to {last} became 0")
            }
            _ => write!(f, "clipped: {samples} of the output samples {first} to {last}"),
        }
    }
}

/// The last of some gaps, and how many there are.
fn gap_line(gaps: &[Gap]) -> Option<String> {
    let last = gaps.last()?.to_string();
    let missing: u64 = gaps.iter().map(|gap| gap.length).sum();
    Some(match gaps.len() {
        1 => last,
        count => format!("{last}; {count} gaps with {missing} samples since the last line"),
    })
}

impl RunObserver {
    /// Says an event, and writes it to the report.
    fn tell(&mut self, event: &str, data: &impl Serialize, text: &str) {
        // Whoever has read the line finds the event in the report.
        self.file.write(event, data);
        say_line(text);
    }

    /// Reports an input that gives nothing, or does again.
    pub(super) fn stalled(&mut self, stall: &Stall) {
        self.tell_news();
        self.tell(if stall.is_over { "stall_over" } else { "stall" }, stall, &stall.to_string());
    }

    /// From now on the captures are compared with the spec of the bank, if they are `comparable`. In a live
    /// run the warnings come as soon as they are known.
    pub(super) fn check_captures(&mut self, bank: &Bank, comparable: bool) {
        self.check = Some(CaptureCheck::new(bank, comparable, self.is_live));
    }

    /// What the comparison found.
    pub(super) fn checked(&mut self) -> Agreement {
        let is_known = matches!(self.check, Some(CaptureCheck::Done(_)));
        let found = self.check.as_mut().map_or_else(|| Verdict::Unjudged.into(), CaptureCheck::finish);
        if !is_known {
            self.warn(&found);
        }
        found
    }

    fn tell_news(&mut self) {
        if let Some(found) = self.check.as_mut().and_then(CaptureCheck::news) {
            self.warn(&found);
        }
    }

    /// What the comparison found, in a live run.
    fn warn(&mut self, found: &Agreement) {
        for text in found.warnings().iter().filter(|_| self.is_live) {
            self.file.write("warning", &json!({ "text": text }));
            say_line(&format!("warning: {text}"));
        }
    }

    /// Reports what happened since the last call, with the frames of this step.
    pub(super) fn step(&mut self, recordings: &[RecordedFrames<'_>], pipeline: &Pipeline<'_>) {
        self.check.iter_mut().for_each(|check| check.observe(recordings));
        self.tell_news();
        let now = Counts {
            frames: self.written.frames + frames_of(recordings),
            samples: pipeline.samples(),
            gaps: pipeline.gaps().len(),
            replaced: pipeline.replaced(),
            clipped: pipeline.clipped(),
        };
        pipeline.gaps()[self.written.gaps..].iter().for_each(|gap| self.file.write("gap", gap));
        self.written.spans(&now).for_each(|span| self.file.write(span.event, &span));
        self.written = now;
        self.report_long_gaps(pipeline);
        if self.is_live && Instant::now() >= self.due {
            self.say(pipeline.gaps());
        }
    }

    /// Says what has happened since the last time.
    fn say(&mut self, gaps: &[Gap]) {
        let gap = gap_line(&gaps[self.said.gaps..]);
        let spans = self.said.spans(&self.written).map(|span| span.to_string());
        for line in gap.into_iter().chain(spans) {
            say_line(&line);
            self.due = Instant::now() + INTERVAL;
        }
        self.said = self.written;
    }

    fn report_long_gaps(&mut self, pipeline: &Pipeline<'_>) {
        let least = self.long_gap;
        for gap in pipeline.open_gaps().filter(|gap| gap.length >= least) {
            if self.long_gaps.insert([gap.channel as u64, gap.first]) {
                self.tell("gap_goes_on", &gap, &format!("{gap} so far"));
            }
        }
    }

    /// Whether standard error had gaps before the end of the run.
    pub(super) fn has_said_gaps(&self) -> bool {
        self.said.gaps > 0 || !self.long_gaps.is_empty()
    }

    /// Ends the report with the summary of the run.
    pub(super) fn end(&mut self, summary: &impl Serialize) -> Result<(), Failure> {
        self.file.write("summary", summary);
        self.file.check()
    }

    /// Ends the report of a run that failed.
    pub(super) fn fail(&mut self, failure: &Failure) {
        if let Failure::Input(message) | Failure::Usage(message) = failure {
            self.file.write("error", &json!({ "message": message }));
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
        let spans: Vec<String> = before.spans(&later).map(|span| span.to_string()).collect();
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
        let gap = |first| Gap { channel: 2, first, length: 10, snr_db: hybank::units::Decibels(12.0) };
        assert_eq!(gap_line(&[]), None);
        assert_eq!(gap_line(&[gap(5)]).unwrap(), "gap: channel 2, sample 5, 10 missing, SNR 12.0 dB there");
        let line = gap_line(&[gap(5), gap(50)]).unwrap();
        assert_eq!(
            line,
            "gap: channel 2, sample 50, 10 missing, SNR 12.0 dB there; 2 gaps with 20 samples since the last line"
        );
    }
}
