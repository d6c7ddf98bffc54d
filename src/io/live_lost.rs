//! Lost samples that are reported while the samples arrive.

use super::IoError;
use super::lost::LostLine;
use crossbeam_channel::{Receiver, Sender, bounded};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::thread;

/// Lines that wait to be used; more wait in the pipe.
const LINES: usize = 1024;
/// Longest line; those of the format have a hundred bytes.
const LONGEST_LINE: u64 = 4096;

/// A pipe of lines as [`LostSamples`](super::LostSamples) has them, read while the samples arrive.
///
/// Lines must come before their samples: what a line says of samples that have been used comes too late, and
/// is counted. The first line of an input with `sample_start` only begins its count; the following ones say
/// what was left out since.
#[derive(Debug, Clone)]
pub struct LiveLost {
    file: String,
    lines: Receiver<Result<LostLine, IoError>>,
}

impl LiveLost {
    /// Begins to read on a thread of its own, which waits for the pipe's writer.
    ///
    /// # Errors
    /// [`IoError`] for a thread that cannot be started.
    pub fn begin(path: &Path) -> Result<Self, IoError> {
        let file = path.display().to_string();
        let (sender, lines) = bounded(LINES);
        let (name, path) = (file.clone(), path.to_owned());
        let thread = thread::Builder::new().name("lost".into());
        let started = thread.spawn(move || read(&path, &name, &sender));
        started.map_err(IoError::system(&file, "start a thread that reads it"))?;
        Ok(Self { file, lines })
    }

    /// A line that is there.
    pub(super) fn next(&self) -> Result<Option<LostLine>, IoError> {
        self.lines.try_recv().ok().transpose()
    }

    /// An error about a line.
    pub(super) fn fault(&self, number: usize, problem: impl std::fmt::Display) -> IoError {
        IoError::unfit(&self.file)(format!("line {number}: {problem}"))
    }
}

/// Sends all lines. The thread ends when they are no longer wanted.
fn read(path: &PathBuf, name: &str, lines: &Sender<Result<LostLine, IoError>>) {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) => return drop(lines.send(Err(IoError::system(name, "open it")(error)))),
    };
    let mut reader = BufReader::new(file);
    for number in 1.. {
        let line = next_line(&mut reader, name, number);
        let is_last = !matches!(line, Some(Ok(_)));
        let is_blank = matches!(&line, Some(Ok(text)) if text.trim().is_empty());
        let fault = |problem| IoError::unfit(name)(format!("line {number}: {problem}"));
        let parsed = line.filter(|_| !is_blank).map(|line| LostLine::parse(&line?, number).map_err(fault));
        if parsed.is_some_and(|line| lines.send(line).is_err()) || is_last {
            return;
        }
    }
}

fn next_line(reader: &mut impl BufRead, name: &str, number: usize) -> Option<Result<String, IoError>> {
    let fault = |problem| IoError::unfit(name)(problem);
    let mut line = Vec::new();
    match reader.take(LONGEST_LINE + 1).read_until(b'\n', &mut line) {
        Err(error) => Some(Err(IoError::system(name, "read it")(error))),
        Ok(0) => None,
        Ok(length) if length as u64 > LONGEST_LINE => Some(Err(fault(format!(
            "line {number} is longer than {LONGEST_LINE} bytes; give one object per line"
        )))),
        Ok(_) => Some(String::from_utf8(line).map_err(|_| fault(format!("line {number} is not UTF-8")))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_bounded_and_named() {
        let mut text = "{}\n".repeat(2);
        text += &"x".repeat(5000);
        let mut reader = BufReader::new(text.as_bytes());
        let mut next = |number| next_line(&mut reader, "lost", number);
        assert_eq!(next(1).unwrap().unwrap(), "{}\n");
        assert_eq!(next(2).unwrap().unwrap(), "{}\n");
        let error = next(3).unwrap().unwrap_err().to_string();
        assert!(error.contains("lost: line 3 is longer than 4096 bytes"), "{error}");
    }
}
