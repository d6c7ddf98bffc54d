//! Lines of text, in UTF-8 or Latin-1, as they come.

use crate::io::IoError;
use std::io::{BufRead, BufReader, Read};

/// Longest line.
const LONGEST_LINE: u64 = 1 << 20;
/// The byte order mark in UTF-8.
const MARK: &[u8] = "\u{feff}".as_bytes();

/// The lines of a file that hold more than spaces.
pub(super) struct Lines<R> {
    reader: BufReader<R>,
    file: String,
    kind: &'static str,
    /// Number of the last line, from 1.
    pub(super) number: u64,
    line: Vec<u8>,
}

impl<R: Read> Lines<R> {
    /// Of a file that is called `file` in messages, and should be of this kind. `buffer` bytes are read at a
    /// time.
    pub(super) fn new(inner: R, file: &str, kind: &'static str, buffer: usize) -> Self {
        let reader = BufReader::with_capacity(buffer, inner);
        Self { reader, file: file.to_owned(), kind, number: 0, line: Vec::new() }
    }

    /// True if a line has come that was not given.
    pub(super) fn is_more_at_hand(&self) -> bool {
        self.reader.buffer().contains(&b'\n')
    }

    /// The next line without its end, in UTF-8; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<&[u8]>, IoError> {
        loop {
            self.line.clear();
            let read = (&mut self.reader).take(LONGEST_LINE + 1).read_until(b'\n', &mut self.line);
            self.number += 1;
            match read.map_err(IoError::reading(&self.file))? {
                0 => return Ok(None),
                length if length as u64 > LONGEST_LINE => {
                    return Err(
                        self.fault(&format!("longer than {LONGEST_LINE} bytes; write one line per frame"))
                    );
                }
                _ => {}
            }
            if self.line.contains(&0) {
                return Err(self.fault("it has a byte of zero: it is no text, or text in UTF-16; save tables in UTF-8"));
            }
            self.decode_as_utf8();
            if !self.line.trim_ascii().is_empty() {
                let end = self.line.iter().rposition(|byte| !matches!(byte, b'\r' | b'\n')).unwrap_or(0);
                if self.line[..end].contains(&b'\r') {
                    return Err(
                        self.fault("its lines end with a carriage return alone; save them with line feeds")
                    );
                }
                return Ok(Some(&self.line[..=end]));
            }
        }
    }

    /// Passes lines by, empty ones too.
    pub(super) fn skip(&mut self, count: u64) -> Result<(), IoError> {
        while self.number < count {
            self.line.clear();
            let read = (&mut self.reader).take(LONGEST_LINE).read_until(b'\n', &mut self.line);
            if read.map_err(IoError::reading(&self.file))? == 0 {
                break;
            }
            self.number += u64::from(self.line.ends_with(b"\n"));
        }
        Ok(())
    }

    /// A line that is not UTF-8 is Latin-1, whose bytes are the first characters of Unicode.
    fn decode_as_utf8(&mut self) {
        if self.number == 1 && self.line.starts_with(MARK) {
            self.line.drain(..MARK.len());
        }
        if !self.line.is_ascii() && str::from_utf8(&self.line).is_err() {
            self.line = self.line.iter().map(|byte| char::from(*byte)).collect::<String>().into_bytes();
        }
    }

    /// What is wrong with the last line.
    pub(super) fn fault(&self, problem: &str) -> IoError {
        self.fault_at(self.number, problem)
    }

    /// What is wrong with a line.
    pub(super) fn fault_at(&self, line: u64, problem: &str) -> IoError {
        IoError::malformed(&self.file, self.kind)(format!("line {line}: {problem}"))
    }
}
