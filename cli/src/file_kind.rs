//! Tells from its first bytes what a file is that was given in place of another.

use super::print::{Failure, failed};
use FileKind::{Foreign, Recording};
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
    /// A recording that is read where the name or an option says what it is.
    Recording(&'static str),
    /// A file of another program, and what to do where a recording is needed.
    Foreign(&'static str, &'static str),
    Unknown,
}

const CONVERT: &str = "convert it to a WAV recording";
const NO_RECORDING: &str = "give a recording";
const WAV: FileKind = Recording("a WAV recording");
const SIGMF: FileKind = Recording("the metadata of a SigMF recording");
const PAGE: FileKind = Foreign("a page or a picture (HTML or SVG)", NO_RECORDING);

/// First bytes of files, from the byte at which they stand.
const MAGIC: [(usize, &[u8], FileKind); 12] = [
    (
        0,
        b"RIFX",
        Foreign("a big-endian WAV recording", "write it as RIFF, with the least significant byte first"),
    ),
    (8, b"WAVE", WAV),
    (0, b"fLaC", Recording("a FLAC recording")),
    (0, b"OggS", Foreign("an Ogg recording", CONVERT)),
    (0, b"ID3", Foreign("an MP3 recording", CONVERT)),
    (8, b"AIFF", Foreign("an AIFF recording", CONVERT)),
    (0, b"\x93NUMPY", Recording("a NumPy array")),
    (0, b"MATLAB 5", Recording("a MATLAB file")),
    (0, b"PK\x03\x04", Foreign("a ZIP or npz archive", "save each array alone, with numpy.save")),
    (0, b"\x89PNG", Foreign("a picture", NO_RECORDING)),
    (257, b"ustar", Foreign("an archive (tar)", "extract it with tar -xf")),
    (1, b"ELF", Foreign("a program", NO_RECORDING)),
];

impl FileKind {
    /// Of a file that begins with these bytes.
    pub(super) fn of(bytes: &[u8]) -> Self {
        let is =
            |&(at, magic, _): &(usize, &[u8], Self)| bytes.get(at..).is_some_and(|b| b.starts_with(magic));
        match MAGIC.iter().find(|entry| is(entry)) {
            Some((_, _, kind)) => *kind,
            None => Self::of_text(&String::from_utf8_lossy(bytes)),
        }
    }

    fn of_text(text: &str) -> Self {
        let begin = text.trim_start_matches('\u{feff}').trim_start();
        if begin.starts_with('{') {
            return match begin {
                _ if begin.contains(FORMAT) => Self::Bank,
                _ if begin.contains("core:datatype") => SIGMF,
                _ => Self::Unknown,
            };
        }
        if begin.starts_with('<') {
            return PAGE;
        }
        let is_key = |line: &str| {
            ["fast_rate", "fast_period", "ratio", "[target]", "[[channel]]"]
                .iter()
                .any(|key| line.trim_start().starts_with(key))
        };
        if begin.lines().any(is_key) { Self::Spec } else { Self::Unknown }
    }

    /// Of the file at `path`; unknown unless it is a regular file that can be read.
    pub(super) fn of_file(path: &Path) -> Self {
        let mut bytes = Vec::new();
        let is_file = path.metadata().is_ok_and(|found| found.is_file());
        let read = is_file.then(|| File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut bytes)));
        if matches!(read, Some(Ok(_))) { Self::of(&bytes) } else { Self::Unknown }
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bank => "a bank",
            Self::Spec => "a spec",
            Self::Recording(name) | Self::Foreign(name, _) => name,
            Self::Unknown => "not known here",
        })
    }
}

/// A file that is known, but is not the bank or spec that is wanted.
pub(super) fn refuse_other(file: &str, found: FileKind, wanted: FileKind) -> Result<(), Failure> {
    let file = Quoted(file);
    let remedy = match (wanted, found) {
        _ if found == wanted => return Ok(()),
        (_, FileKind::Unknown) => return Ok(()),
        (FileKind::Bank, FileKind::Spec) => format!("design it first: hybank design {file} -o bank.json"),
        (FileKind::Spec, FileKind::Bank) => "its spec is the table \"spec\" in the file".to_owned(),
        (FileKind::Spec, _) => "`hybank init` writes one to begin with".to_owned(),
        _ => "`hybank design` makes one from a spec".to_owned(),
    };
    Err(Failure::Input(format!("{file}: this is {found}, and {wanted} is needed; {remedy}")))
}

/// Why captures cannot be read; a file that is something else is named for what it is.
pub(super) fn unreadable(error: IoError) -> Failure {
    let IoError::NotWav { file, .. } = &error else { return failed(error) };
    match FileKind::of_file(Path::new(file)) {
        // A WAV header that the reader refused has its own error.
        FileKind::Unknown | WAV => failed(error),
        found @ (FileKind::Bank | FileKind::Spec) => Failure::Input(format!(
            "{}: this is {found}, and a recording is needed; give the captures after the bank or the spec",
            Quoted(file)
        )),
        found @ Recording(_) => Failure::Input(format!(
            "{}: this is {found}, and neither its name nor --format says so; rename it to the usual ending",
            Quoted(file)
        )),
        found @ Foreign(_, remedy) => {
            Failure::Input(format!("{}: this is {found}, which is not read; {remedy}", Quoted(file)))
        }
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
        for other in ["", "{}", "# nothing", "a = 1", "precious"] {
            assert_eq!(FileKind::of(other.as_bytes()), FileKind::Unknown, "{other}");
        }
        for (bytes, name) in [
            (&b"RIFF\x24\0\0\0WAVEfmt "[..], "a WAV recording"),
            (b"\x93NUMPY\x01\0v\0", "a NumPy array"),
            (b"<!DOCTYPE html>\nratio of", "a page or a picture (HTML or SVG)"),
            (b"{\"global\": {\"core:datatype\": \"cf32_le\"}}", "the metadata of a SigMF recording"),
        ] {
            assert_eq!(FileKind::of(bytes).to_string(), name);
        }
    }
}
