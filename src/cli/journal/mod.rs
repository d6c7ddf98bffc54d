//! What happens during a run, reported while it happens: lines on standard error, and JSON lines in the file
//! of `--report`. A thread of its own writes them, so that the samples never wait for a reader of messages.

mod event;
mod report_file;
mod scribe;

use super::Failure;
use super::bank_file::is_dash;
use super::say::say_line;
use crate::io::StallWatch;
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
pub(super) use event::{Event, Span};
use report_file::ReportFile;
use scribe::Scribe;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;
use std::time::{Duration, Instant};

/// Events that wait to be written; further ones are counted only.
const WAITING: usize = 4096;
/// Time after which an input that gives nothing is named.
const PATIENCE: Duration = Duration::from_secs(1);
/// Longest sleep of the writer.
const LONG: Duration = Duration::from_secs(3600);

/// The option of the commands that fuse.
#[derive(Debug, clap::Args)]
pub(super) struct JournalArgs {
    /// Write what happens as JSON lines while it happens: gaps, clipping, stalls, warnings, and the report
    /// at the end as the last line. A FIFO will do; `-` is standard output
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

impl JournalArgs {
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

    /// Begins the journal of a run.
    pub(super) fn begin(&self, force: bool) -> Result<Journal, Failure> {
        let report = self.report().map(|path| ReportFile::create(path, force)).transpose()?;
        Ok(Journal::begin(report))
    }
}

/// The journal of a run; all clones are one.
#[derive(Clone)]
pub(super) struct Journal {
    sink: Arc<Sink>,
    /// Events that found no room.
    dropped: Arc<AtomicU64>,
}

enum Sink {
    Thread(Sender<Message>),
    /// No thread could be started.
    Here(Box<Mutex<Scribe>>),
}

enum Message {
    Event(Event),
    /// Stop saying what waits; the answer is whether gaps were said.
    Quiet(Sender<bool>),
    /// The last line of the report; the answer is what could not be written.
    End(serde_json::Value, Sender<Result<(), String>>),
}

impl Journal {
    fn begin(report: Option<ReportFile>) -> Self {
        let scribe = Scribe::new(report, Instant::now(), Box::new(say_line));
        let (sender, messages) = bounded(WAITING);
        // The thread takes the scribe only once it runs.
        let (hand_over, taken) = bounded(1);
        let thread = Builder::new().name("journal".into());
        let started = thread.spawn(move || {
            if let Ok(scribe) = taken.recv() {
                write_all(scribe, &messages);
            }
        });
        let sink = match started {
            Ok(_) => {
                // The thread waits for it.
                let _ = hand_over.send(scribe);
                Sink::Thread(sender)
            }
            Err(_) => Sink::Here(Box::new(Mutex::new(scribe))),
        };
        Self { sink: Arc::new(sink), dropped: Arc::default() }
    }

    /// Tells an event, without waiting.
    pub(super) fn report(&self, event: Event) {
        match &*self.sink {
            Sink::Thread(messages) => {
                let has_room = messages.try_send(Message::Event(event)).is_ok();
                self.dropped.fetch_add(u64::from(!has_room), Ordering::Relaxed);
            }
            Sink::Here(scribe) => locked(scribe).take(event, Instant::now()),
        }
    }

    /// Where the readers report inputs that give nothing.
    pub(super) fn stall_watch(&self) -> StallWatch {
        let journal = self.clone();
        StallWatch { patience: PATIENCE, report: Arc::new(move |stall| journal.report(stall.into())) }
    }

    /// Nothing more is said on standard error; gives whether gaps were.
    pub(super) fn quiet(&self) -> bool {
        match &*self.sink {
            Sink::Thread(messages) => ask(messages, Message::Quiet).unwrap_or(false),
            Sink::Here(scribe) => {
                let mut scribe = locked(scribe);
                scribe.quiet(Instant::now());
                scribe.has_said_gaps
            }
        }
    }

    /// Ends the report with the summary of the run.
    pub(super) fn end(&self, summary: &impl serde::Serialize) -> Result<(), Failure> {
        let mut last = serde_json::json!({ "event": "summary" });
        let summary = serde_json::to_value(summary).map_err(Failure::input)?;
        if let (Some(last), serde_json::Value::Object(summary)) = (last.as_object_mut(), summary) {
            last.extend(summary);
        }
        self.end_with(last)
    }

    /// Ends the report of a run that failed.
    pub(super) fn fail(&self, failure: &Failure) {
        if let Failure::Input(message) | Failure::Usage(message) = failure {
            // The failure itself is what matters.
            let _ = self.end_with(serde_json::json!({ "event": "error", "message": message }));
        }
    }

    fn end_with(&self, mut last: serde_json::Value) -> Result<(), Failure> {
        let dropped = self.dropped.load(Ordering::Relaxed);
        if let Some(last) = last.as_object_mut().filter(|_| dropped > 0) {
            last.insert("events_dropped".into(), dropped.into());
        }
        let ended = match &*self.sink {
            Sink::Thread(messages) => ask(messages, |answer| Message::End(last, answer)).unwrap_or(Ok(())),
            Sink::Here(scribe) => locked(scribe).end(&last, Instant::now()),
        };
        ended.map_err(Failure::Input)
    }
}

fn locked(scribe: &Mutex<Scribe>) -> std::sync::MutexGuard<'_, Scribe> {
    scribe.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The answer of the thread, unless it has died.
fn ask<T>(messages: &Sender<Message>, message: impl FnOnce(Sender<T>) -> Message) -> Option<T> {
    let (sender, answer) = bounded(1);
    messages.send(message(sender)).ok()?;
    answer.recv().ok()
}

/// The thread: until the journal is dropped.
fn write_all(mut scribe: Scribe, messages: &Receiver<Message>) {
    loop {
        let due = scribe.next().map_or(LONG, |next| next.saturating_duration_since(Instant::now()));
        match messages.recv_timeout(due) {
            Ok(Message::Event(event)) => scribe.take(event, Instant::now()),
            Ok(Message::Quiet(answer)) => {
                scribe.quiet(Instant::now());
                let _ = answer.send(scribe.has_said_gaps);
            }
            Ok(Message::End(last, answer)) => {
                let _ = answer.send(scribe.end(&last, Instant::now()));
            }
            Err(RecvTimeoutError::Timeout) => scribe.say_due(Instant::now()),
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}
