//! What happens during a run, as lines of text and as JSON lines.

use super::print::{Failure, failed, is_dash};
use crossbeam_channel::Sender;
use hybank::files::FileError;
use hybank::io::{Stall, Stdout, is_pipe};
use hybank::messages::Quoted;
use hybank::pipeline::{Gap, LISTED_GAPS};
use std::fmt;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Least time between two lines of one kind. The first one comes no earlier than this after the beginning:
/// the report of a shorter run comes at once.
const INTERVAL: Duration = Duration::from_secs(1);

/// An event of a run.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub(super) enum Event {
    /// A gap that has ended.
    Gap(Gap),
    /// A gap that has lasted for a while and goes on.
    GapGoesOn(Gap),
    /// Input samples that were NaN or infinite became 0.
    Replaced(Span),
    /// Output samples saturated.
    Clipped(Span),
    /// An input gives nothing.
    Stall(Wait),
    /// It does again.
    StallOver(Wait),
    /// A fault that is known before the end.
    Warning {
        /// What it is.
        text: String,
    },
}

/// Some of the samples (of the output) or frames (of the input) from `first` to `last`, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub(super) struct Span {
    pub(super) first: u64,
    pub(super) last: u64,
    /// How many samples.
    pub(super) samples: u64,
}

/// A wait for an input.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub(super) struct Wait {
    input: String,
    /// First and last channel, from 1.
    channels: [usize; 2],
    seconds: f64,
}

/// Takes events, without waiting; all clones are one.
#[derive(Clone)]
pub(super) struct Events {
    /// `None` ends the thread.
    pub(super) messages: Sender<Option<Event>>,
    /// Events that found no room.
    pub(super) dropped: Arc<AtomicU64>,
}

impl Events {
    /// Tells an event.
    pub(super) fn report(&self, event: Event) {
        let has_room = self.messages.try_send(Some(event)).is_ok();
        self.dropped.fetch_add(u64::from(!has_room), Ordering::Relaxed);
    }
}

impl From<&Stall> for Event {
    fn from(stall: &Stall) -> Self {
        let wait = Wait {
            input: stall.input.clone(),
            channels: [*stall.channels.start(), *stall.channels.end()],
            // Rounded to milliseconds.
            seconds: stall.waited.as_millis() as f64 / 1e3,
        };
        if stall.is_over { Self::StallOver(wait) } else { Self::Stall(wait) }
    }
}

impl Wait {
    fn who(&self) -> String {
        let Self { input, channels: [first, last], .. } = self;
        match first == last {
            true => format!("channel {first} ({})", Quoted(input)),
            false => format!("channels {first} to {last} ({})", Quoted(input)),
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gap(Gap { channel, first, length }) => {
                write!(f, "gap: channel {channel}, sample {first}, {length} missing")
            }
            Self::GapGoesOn(Gap { channel, first, length }) => {
                write!(f, "gap: channel {channel}, sample {first}, {length} missing so far")
            }
            Self::Replaced(Span { first, last, samples }) => {
                write!(f, "not finite: {samples} input samples of frames {first} to {last} became 0")
            }
            Self::Clipped(Span { first, last, samples }) => {
                write!(f, "clipped: {samples} of the output samples {first} to {last}")
            }
            Self::Stall(wait) => write!(f, "waiting for {}", wait.who()),
            Self::StallOver(wait) => write!(f, "{} goes on after {:.1} s", wait.who(), wait.seconds),
            Self::Warning { text } => write!(f, "warning: {text}"),
        }
    }
}

/// Where the lines of text go.
pub(super) type Print = Box<dyn FnMut(&str) + Send>;

/// Writes events.
pub(super) struct EventWriter {
    begun: Instant,
    print: Print,
    report: Option<ReportFile>,
    gaps: Limit<Gaps>,
    replaced: Limit<Span>,
    clipped: Limit<Span>,
    /// Gaps in the report.
    listed: u64,
    /// Gaps were said.
    pub(super) has_said_gaps: bool,
}

/// Gaps of one line.
#[derive(Debug, Clone, Copy)]
struct Gaps {
    last: Gap,
    count: u64,
    missing: u64,
}

/// What waits for the time of its line.
struct Limit<T> {
    next: Instant,
    held: Option<T>,
}

impl<T> Limit<T> {
    /// The held value, if its time has come.
    fn due(&mut self, now: Instant) -> Option<T> {
        if now < self.next {
            return None;
        }
        let held = self.held.take()?;
        self.next = now + INTERVAL;
        Some(held)
    }
}

impl Limit<Span> {
    /// Holds both spans as one.
    fn hold(&mut self, later: Span) {
        match &mut self.held {
            Some(held) => {
                held.last = held.last.max(later.last);
                held.samples += later.samples;
            }
            None => self.held = Some(later),
        }
    }
}

impl EventWriter {
    pub(super) fn new(report: Option<ReportFile>, begun: Instant, print: Print) -> Self {
        let next = begun + INTERVAL;
        Self {
            begun,
            print,
            report,
            gaps: Limit { next, held: None },
            replaced: Limit { next, held: None },
            clipped: Limit { next, held: None },
            listed: 0,
            has_said_gaps: false,
        }
    }

    /// Takes an event that happens `now`.
    pub(super) fn take(&mut self, event: Event, now: Instant) {
        match event {
            Event::Gap(gap) => {
                if self.listed < LISTED_GAPS as u64 {
                    self.write(&event, now);
                }
                self.listed += 1;
                let held = self.gaps.held.get_or_insert(Gaps { last: gap, count: 0, missing: 0 });
                *held = Gaps { last: gap, count: held.count + 1, missing: held.missing + gap.length };
            }
            Event::Replaced(span) => self.replaced.hold(span),
            Event::Clipped(span) => self.clipped.hold(span),
            event => {
                self.write(&event, now);
                self.has_said_gaps |= matches!(event, Event::GapGoesOn(_));
                (self.print)(&event.to_string());
            }
        }
        self.say_due(now);
    }

    /// Prints what has waited long enough.
    pub(super) fn say_due(&mut self, now: Instant) {
        if let Some(Gaps { last, count, missing }) = self.gaps.due(now) {
            let more = match count {
                1 => String::new(),
                _ => format!("; {count} gaps with {missing} samples in the last second"),
            };
            (self.print)(&format!("{}{more}", Event::Gap(last)));
            self.has_said_gaps = true;
        }
        let spans = [self.replaced.due(now).map(Event::Replaced), self.clipped.due(now).map(Event::Clipped)];
        for event in spans.into_iter().flatten() {
            self.write(&event, now);
            (self.print)(&event.to_string());
        }
    }

    /// When the next line is due.
    pub(super) fn next(&self) -> Option<Instant> {
        let gaps = self.gaps.held.map(|_| self.gaps.next);
        let spans = [&self.replaced, &self.clipped].map(|limit| limit.held.map(|_| limit.next));
        spans.into_iter().chain([gaps]).flatten().min()
    }

    /// Prints nothing more of what waits: the summary does. The report gets it.
    pub(super) fn quiet(&mut self, now: Instant) {
        self.gaps.held = None;
        let spans =
            [self.replaced.held.take().map(Event::Replaced), self.clipped.held.take().map(Event::Clipped)];
        spans.into_iter().flatten().for_each(|event| self.write(&event, now));
    }

    /// Writes the last line of the report.
    pub(super) fn end(&mut self, last: &serde_json::Value, now: Instant) -> Result<(), String> {
        self.write(last, now);
        self.report.take().map_or(Ok(()), ReportFile::close)
    }

    fn write(&mut self, line: &impl serde::Serialize, now: Instant) {
        if let Some(report) = &mut self.report {
            report.write(line, now.duration_since(self.begun));
        }
    }
}

/// The open report.
pub(super) struct ReportFile {
    file: Box<dyn Write + Send>,
    name: String,
    /// The first error; nothing is written after it.
    error: Option<io::Error>,
}

/// A line with its time.
#[derive(serde::Serialize)]
struct Line<'a, T> {
    /// Seconds since the run began.
    at: f64,
    #[serde(flatten)]
    line: &'a T,
}

impl ReportFile {
    /// Begins a report; `-` is standard output. A file that exists is replaced only with `force`, at once: a
    /// report is read while it grows. A FIFO waits for its reader.
    pub(super) fn create(path: &Path, force: bool) -> Result<Self, Failure> {
        let name = if is_dash(path) { "standard output".to_owned() } else { path.display().to_string() };
        let refused = |error| failed(FileError::system(&name, "create it")(error));
        let file: Box<dyn Write + Send> = if is_dash(path) {
            Box::new(Stdout::for_samples().map_err(refused)?.for_reports())
        } else if is_pipe(path) {
            Box::new(Stdout::fifo(path).map_err(refused)?.for_reports())
        } else {
            if !force && path.is_file() {
                return Err(failed(FileError::Exists { file: name }));
            }
            let file = OpenOptions::new().write(true).create(true).truncate(true).open(path);
            Box::new(file.map_err(refused)?)
        };
        Ok(Self { file, name, error: None })
    }

    /// Appends a line.
    pub(super) fn write(&mut self, line: &impl serde::Serialize, at: Duration) {
        if self.error.is_some() {
            return;
        }
        let at = (at.as_secs_f64() * 1e3).round() / 1e3;
        let written = serde_json::to_string(&Line { at, line })
            .map_err(io::Error::other)
            .and_then(|text| self.file.write_all((text + "\n").as_bytes()));
        self.error = written.err();
    }

    /// The error of the first line that could not be written.
    pub(super) fn close(self) -> Result<(), String> {
        match self.error {
            // The reader of a pipe has seen enough.
            Some(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                Err(format!("{}: cannot write it: {error}", self.name))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    fn gap(first: u64) -> Event {
        Event::Gap(Gap { channel: 2, first, length: 10 })
    }

    #[test]
    fn each_kind_has_a_line_a_second_and_what_ends_early_none() {
        let said = Arc::new(Mutex::new(Vec::new()));
        let lines = Arc::clone(&said);
        let begun = Instant::now();
        let print = Box::new(move |line: &str| lines.lock().unwrap().push(line.to_owned()));
        let mut writer = EventWriter::new(None, begun, print);
        let at = |milliseconds: u64| begun + Duration::from_millis(milliseconds);
        let clipped = |first, last, samples| Event::Clipped(Span { first, last, samples });
        writer.take(gap(5), at(200));
        writer.take(clipped(0, 9, 3), at(300));
        assert!(said.lock().unwrap().is_empty() && writer.next() == Some(at(1000)));
        writer.take(gap(50), at(400));
        writer.say_due(at(1000));
        writer.take(clipped(20, 29, 4), at(1500));
        writer.take(clipped(30, 39, 1), at(1600));
        assert_eq!(writer.next(), Some(at(2000)));
        writer.say_due(at(2000));
        // Long after the last line it comes at once.
        writer.take(gap(900), at(5000));
        writer.take(gap(990), at(5001));
        writer.quiet(at(5002));
        writer.say_due(at(9000));
        let want = [
            "gap: channel 2, sample 50, 10 missing; 2 gaps with 20 samples in the last second",
            "clipped: 3 of the output samples 0 to 9",
            "clipped: 5 of the output samples 20 to 39",
            "gap: channel 2, sample 900, 10 missing",
        ];
        assert_eq!(*said.lock().unwrap(), want);
    }
}
