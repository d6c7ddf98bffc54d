//! Tells a spec and a bank that were given in place of one another, or of a recording.

use super::print::{Failure, failed};
use hybank::bank::FORMAT;
use hybank::io::IoError;
use hybank::messages::Quoted;
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes that tell what a file is.
const HEAD: u64 = 4096;

/// What a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FileKind {
    Bank,
    Spec,
    Other,
}

impl FileKind {
    /// Of a file that begins with these bytes.
    pub(super) fn of(bytes: &[u8]) -> Self {
        let text = String::from_utf8_lossy(bytes);
        let begin = text.trim_start_matches('\u{feff}').trim_start();
        let is_key = |line: &str| {
            ["fast_rate", "fast_period", "ratio", "[target]", "[[channel]]"]
                .iter()
                .any(|key| line.trim_start().starts_with(key))
        };
        match begin.chars().next() {
            Some('{') if begin.contains(FORMAT) => Self::Bank,
            Some('{' | '<') => Self::Other,
            _ if begin.lines().any(is_key) => Self::Spec,
            _ => Self::Other,
        }
    }

    /// Of the file at `path`; another kind unless it is a regular file that can be read.
    fn of_file(path: &Path) -> Self {
        let mut bytes = Vec::new();
        let is_file = path.metadata().is_ok_and(|found| found.is_file());
        let read = is_file.then(|| File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut bytes)));
        if matches!(read, Some(Ok(_))) { Self::of(&bytes) } else { Self::Other }
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bank => "a bank",
            Self::Spec => "a spec",
            Self::Other => "no file of hybank",
        })
    }
}

/// Refuses a spec in place of a bank, and a bank in place of a spec.
pub(super) fn refuse_other(file: &str, found: FileKind, wanted: FileKind) -> Result<(), Failure> {
    let file = Quoted(file);
    let remedy = match (wanted, found) {
        (FileKind::Bank, FileKind::Spec) => format!("design it first: hybank design {file} -o bank.json"),
        (FileKind::Spec, FileKind::Bank) => "its spec is the table \"spec\" in the file".to_owned(),
        _ => return Ok(()),
    };
    Err(Failure::Input(format!("{file}: this is {found}, and {wanted} is needed; {remedy}")))
}

/// Why captures cannot be read; a spec or a bank in their place is named for what it is.
pub(super) fn unreadable(error: IoError) -> Failure {
    let IoError::NotWav { file, .. } = &error else { return failed(error) };
    match FileKind::of_file(Path::new(file)) {
        FileKind::Other => failed(error),
        found => Failure::Input(format!(
            "{}: this is {found}, and a recording is needed; give the captures after the bank or the spec",
            Quoted(file)
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_their_first_bytes() {
        for spec in
            [include_str!("../filters/interleaved-4x250M.toml"), include_str!("../filters/thesis-iir.toml")]
        {
            assert_eq!(FileKind::of(spec.as_bytes()), FileKind::Spec);
        }
        let bank = include_str!("../filters/thesis-fir.json");
        assert_eq!(FileKind::of(bank.as_bytes()), FileKind::Bank);
        for other in ["", "{}", "# nothing", "a = 1", "RIFF\x24\0\0\0WAVEfmt ", "<!DOCTYPE html>\nratio of"] {
            assert_eq!(FileKind::of(other.as_bytes()), FileKind::Other, "{other}");
        }
    }
}
