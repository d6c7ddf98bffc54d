//! The observer of a run: reports what happens while it happens, as lines on standard error and as JSON
//! lines in the file of `--report`, and checks the captures. A thread of its own writes, so that the samples
//! never wait for a reader of messages.

use super::capture_check::{CaptureCheck, Checked};
use super::event::{Event, EventWriter, Events, ReportFile, Span};
use super::print::{Failure, is_dash};
use super::print::{failed, say_line};
use crossbeam_channel::{Receiver, RecvTimeoutError, bounded};
use hybank::bank::Bank;
use hybank::io::{PcmFrames, StallWatch};
use hybank::pipeline::{Gap, Pipeline};
use hybank::runtime::Input;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// Events that wait to be written; further ones are counted only.
const WAITING: usize = 4096;
/// Time between two looks whether the thread that empties a full queue still runs.
const FULL_QUEUE: Duration = Duration::from_millis(50);
/// Time after which an input that gives nothing, or a gap that goes on, is reported.
const PATIENCE: Duration = Duration::from_secs(1);
/// Longest sleep of the writer.
const LONG: Duration = Duration::from_secs(3600);

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

    /// Begins to observe a run.
    pub(super) fn begin(&self, force: bool) -> Result<RunObserver, Failure> {
        let report = self.report().map(|path| ReportFile::create(path, force)).transpose()?;
        Ok(RunObserver::begin(EventWriter::new(report, Instant::now(), Box::new(say_line))))
    }
}

/// Observes a run.
pub(super) struct RunObserver {
    events: Events,
    waiting: Receiver<Option<Event>>,
    writer: Arc<Mutex<EventWriter>>,
    /// Without one, the observer writes step by step.
    thread: Option<JoinHandle<()>>,
    check: Option<CaptureCheck>,
    /// What has been reported.
    frames: u64,
    samples: u64,
    gaps: usize,
    replaced: u64,
    clipped: u64,
    /// The gap of each channel that goes on.
    open: Vec<OpenGap>,
}

/// A gap that goes on.
#[derive(Debug, Clone, Copy)]
struct OpenGap {
    channel: usize,
    first: u64,
    since: Instant,
    is_reported: bool,
}

impl RunObserver {
    fn begin(writer: EventWriter) -> Self {
        let (messages, waiting) = bounded(WAITING);
        let writer = Arc::new(Mutex::new(writer));
        let (shared, received) = (Arc::clone(&writer), waiting.clone());
        let thread = Builder::new().name("events".into()).spawn(move || write_all(&shared, &received)).ok();
        let events = Events { messages, dropped: Arc::default() };
        let (check, open) = (None, Vec::new());
        let [frames, samples, replaced, clipped] = [0; 4];
        Self { events, waiting, writer, thread, check, frames, samples, gaps: 0, replaced, clipped, open }
    }

    /// Where other threads report events.
    pub(super) fn events(&self) -> Events {
        self.events.clone()
    }

    /// Where the readers report inputs that give nothing.
    pub(super) fn stall_watch(&self) -> StallWatch {
        let events = self.events();
        StallWatch { patience: PATIENCE, report: Arc::new(move |stall| events.report(stall.into())) }
    }

    /// From now on the captures are compared with the spec of the bank, if they are `comparable`. In a
    /// `live` run the warnings come as soon as they are known.
    pub(super) fn check_captures(&mut self, bank: &Bank, comparable: bool, live: bool) {
        self.check = Some(CaptureCheck::new(bank, comparable, live.then(|| self.events())));
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
        let frames = self.frames + recordings.frames() as u64;
        let (samples, replaced, clipped) = (pipeline.samples(), pipeline.replaced(), pipeline.clipped());
        if replaced > self.replaced {
            self.events.report(Event::Replaced(span(self.frames, frames, replaced - self.replaced)));
        }
        if clipped > self.clipped {
            self.events.report(Event::Clipped(span(self.samples, samples, clipped - self.clipped)));
        }
        (self.frames, self.samples, self.replaced, self.clipped) = (frames, samples, replaced, clipped);
        let gaps = pipeline.gaps();
        gaps[self.gaps..].iter().for_each(|&gap| self.events.report(Event::Gap(gap)));
        self.gaps = gaps.len();
        self.open_gaps(pipeline);
        if self.thread.is_none()
            && let Some(mut writer) = self.writer()
        {
            writer.say_due(Instant::now());
        }
    }

    fn open_gaps(&mut self, pipeline: &Pipeline<'_>) {
        let known = std::mem::take(&mut self.open);
        for gap in pipeline.open_gaps() {
            let Gap { channel, first, .. } = gap;
            let is_this = |open: &&OpenGap| (open.channel, open.first) == (channel, first);
            let new = OpenGap { channel, first, since: Instant::now(), is_reported: false };
            let mut open = known.iter().find(is_this).copied().unwrap_or(new);
            if !open.is_reported && open.since.elapsed() >= PATIENCE {
                self.events.report(Event::GapGoesOn(gap));
                open.is_reported = true;
            }
            self.open.push(open);
        }
    }

    /// Nothing more is said on standard error; gives whether gaps were.
    pub(super) fn quiet(&mut self) -> bool {
        self.writer().is_some_and(|mut writer| {
            writer.quiet(Instant::now());
            writer.has_said_gaps
        })
    }

    /// Ends the report with the summary of the run.
    pub(super) fn end(&mut self, summary: &impl serde::Serialize) -> Result<(), Failure> {
        let mut last = serde_json::json!({ "event": "summary" });
        let summary = serde_json::to_value(summary).map_err(failed)?;
        if let (Some(last), serde_json::Value::Object(summary)) = (last.as_object_mut(), summary) {
            last.extend(summary);
        }
        self.end_with(last)
    }

    /// Ends the report of a run that failed.
    pub(super) fn fail(&mut self, failure: &Failure) {
        if let Failure::Input(message) | Failure::Usage(message) = failure {
            // The failure itself is what matters.
            let _ = self.end_with(serde_json::json!({ "event": "error", "message": message }));
        }
    }

    fn end_with(&mut self, mut last: serde_json::Value) -> Result<(), Failure> {
        let dropped = self.events.dropped.load(Ordering::Relaxed);
        if let Some(last) = last.as_object_mut().filter(|_| dropped > 0) {
            last.insert("events_dropped".into(), dropped.into());
        }
        let died = || failed("the thread that reports events has died, so reports are incomplete");
        self.writer().ok_or_else(died)?.end(&last, Instant::now()).map_err(Failure::Input)
    }

    /// The writer, once it has written what waits; `None` if its thread has died.
    fn writer(&mut self) -> Option<MutexGuard<'_, EventWriter>> {
        if let Some(thread) = self.thread.take() {
            // A thread that has died takes nothing, so that the queue may stay full, and leaves the writer
            // poisoned.
            while !thread.is_finished() && self.events.messages.send_timeout(None, FULL_QUEUE).is_err() {}
            let _ = thread.join();
        }
        let mut writer = self.writer.lock().ok()?;
        self.waiting.try_iter().flatten().for_each(|event| writer.take(event, Instant::now()));
        Some(writer)
    }
}

/// The thread, until the run is over.
fn write_all(writer: &Mutex<EventWriter>, events: &Receiver<Option<Event>>) {
    let mut due = LONG;
    loop {
        let event = events.recv_timeout(due);
        let Ok(mut writer) = writer.lock() else { return };
        match event {
            Ok(Some(event)) => writer.take(event, Instant::now()),
            Err(RecvTimeoutError::Timeout) => writer.say_due(Instant::now()),
            Ok(None) | Err(RecvTimeoutError::Disconnected) => return,
        }
        due = writer.next().map_or(LONG, |next| next.saturating_duration_since(Instant::now()));
    }
}

fn span(begin: u64, end: u64, samples: u64) -> Span {
    Span { first: begin, last: end.saturating_sub(1).max(begin), samples }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_writer_that_died_is_an_error_at_the_end_of_the_run() {
        let print = Box::new(|line: &str| panic!("{line}"));
        let mut observer = RunObserver::begin(EventWriter::new(None, Instant::now(), print));
        // More than the queue holds.
        for _ in 0..WAITING + 2 {
            observer.events().report(Event::Warning { text: "a message that cannot be written".into() });
        }
        assert!(!observer.quiet());
        let Err(Failure::Input(message)) = observer.end(&serde_json::json!({})) else { panic!("no failure") };
        assert!(message.contains("has died"), "{message}");
    }
}
