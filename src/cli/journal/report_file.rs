//! The file of `--report`: JSON lines, each of which can be read as soon as it is written.

use super::super::Failure;
use super::super::bank_file::is_dash;
use crate::files::FileError;
use crate::io::{Stdout, is_pipe};
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

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
        let refused = |error| Failure::input(FileError::system(&name, "create it")(error));
        let file: Box<dyn Write + Send> = if is_dash(path) {
            Box::new(Stdout::for_samples().map_err(refused)?)
        } else if is_pipe(path) {
            Box::new(Stdout::fifo(path).map_err(refused)?)
        } else {
            if !force && path.is_file() {
                return Err(Failure::input(FileError::Exists { file: name }));
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
