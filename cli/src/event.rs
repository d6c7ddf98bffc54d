//! What happens during a run, as lines of text and as JSON lines.

use super::print::{Failure, failed, is_dash, say_line};
use hybank::files::FileError;
use hybank::io::{Stall, is_pipe, open_fifo, stdout_file};
use hybank::messages::Quoted;
use hybank::pipeline::Gap;
use std::fmt;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

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

/// Where events go, from whatever thread they come; all clones are one.
#[derive(Clone)]
pub(super) struct Events(Arc<Mutex<Journal>>);

/// The report of `--report`, if one is asked for.
struct Journal {
    begun: Instant,
    file: Option<Box<dyn Write + Send>>,
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

impl Events {
    /// Begins a run, with its report at `path`; `-` is standard output. A file that exists is replaced only
    /// with `force`, at once: a report is read while it grows. A FIFO waits for its reader.
    pub(super) fn begin(path: Option<&Path>, force: bool) -> Result<Self, Failure> {
        let is_stdout = path.is_some_and(is_dash);
        let name = match path {
            Some(path) if !is_stdout => path.display().to_string(),
            _ => "standard output".to_owned(),
        };
        let file = match path {
            Some(path) if !is_stdout && !is_pipe(path) && !force && path.is_file() => {
                return Err(failed(FileError::Exists { file: name }));
            }
            path => path.map(open).transpose().map_err(FileError::system(&name, "create it")),
        };
        let file = file.map_err(failed)?;
        Ok(Self(Arc::new(Mutex::new(Journal { begun: Instant::now(), file, name, error: None }))))
    }

    /// Says an event, and writes it to the report.
    pub(super) fn tell(&self, event: &Event) {
        say_line(&event.to_string());
        self.write(event);
    }

    /// Writes a line to the report.
    pub(super) fn write(&self, line: &impl serde::Serialize) {
        self.journal().write(line);
    }

    /// The error of the first line of the report that could not be written.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let journal = self.journal();
        match &journal.error {
            // The reader of a pipe has seen enough.
            Some(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                Err(Failure::Input(format!("{}: cannot write it: {error}", journal.name)))
            }
            _ => Ok(()),
        }
    }

    fn journal(&self) -> MutexGuard<'_, Journal> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn open(path: &Path) -> io::Result<Box<dyn Write + Send>> {
    Ok(match path {
        _ if is_dash(path) => Box::new(stdout_file()?),
        _ if is_pipe(path) => Box::new(open_fifo(path)?),
        _ => Box::new(OpenOptions::new().write(true).create(true).truncate(true).open(path)?),
    })
}

impl Journal {
    fn write(&mut self, line: &impl serde::Serialize) {
        let Some(file) = self.file.as_mut().filter(|_| self.error.is_none()) else { return };
        let at = (self.begun.elapsed().as_secs_f64() * 1e3).round() / 1e3;
        let written = serde_json::to_string(&Line { at, line })
            .map_err(io::Error::other)
            .and_then(|text| file.write_all((text + "\n").as_bytes()));
        self.error = written.err();
    }
}
