//! The file of `--report`: what happens during a run, as JSON lines.

use super::print::{Failure, failed, is_dash};
use hybank::files::FileError;
use hybank::io::{is_pipe, open_fifo, stdout_file};
use serde::Serialize;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;
use std::time::Instant;

/// The file, if one is asked for.
pub(super) struct EventFile {
    begun: Instant,
    file: Option<Box<dyn Write>>,
    name: String,
    /// The first error; nothing is written after it.
    error: Option<io::Error>,
}

/// An event with its time.
#[derive(Serialize)]
struct EventLine<'a, T> {
    /// Seconds since the run began.
    at: f64,
    event: &'a str,
    #[serde(flatten)]
    data: &'a T,
}

impl EventFile {
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
        Ok(Self { begun: Instant::now(), file: file.map_err(failed)?, name, error: None })
    }

    /// Writes an event.
    pub(super) fn write(&mut self, event: &str, data: &impl Serialize) {
        let Some(file) = self.file.as_mut().filter(|_| self.error.is_none()) else { return };
        let at = (self.begun.elapsed().as_secs_f64() * 1e3).round() / 1e3;
        let written = serde_json::to_string(&EventLine { at, event, data })
            .map_err(io::Error::other)
            .and_then(|text| file.write_all((text + "\n").as_bytes()));
        self.error = written.err();
    }

    /// The error of the first line that could not be written.
    pub(super) fn check(&self) -> Result<(), Failure> {
        match &self.error {
            // The reader of a pipe has seen enough.
            Some(error) if error.kind() != io::ErrorKind::BrokenPipe => {
                Err(Failure::Input(format!("{}: cannot write it: {error}", self.name)))
            }
            _ => Ok(()),
        }
    }
}

fn open(path: &Path) -> io::Result<Box<dyn Write>> {
    Ok(match path {
        _ if is_dash(path) => Box::new(stdout_file()?),
        _ if is_pipe(path) => Box::new(open_fifo(path)?),
        _ => Box::new(OpenOptions::new().write(true).create(true).truncate(true).open(path)?),
    })
}
