//! Lines of text, in UTF-8, UTF-16 or Windows-1252 (Latin-1), as they come.

use crate::io::IoError;
use encoding_rs::{Decoder, UTF_16BE, UTF_16LE, WINDOWS_1252};
use std::io::{self, BufRead, BufReader, ErrorKind, Read};

/// Longest line.
const LONGEST_LINE: u64 = 1 << 20;
/// Bytes of UTF-16 that are decoded at a time.
const DECODED: usize = 1 << 16;
/// The byte order mark in UTF-8.
const MARK: &[u8] = "\u{feff}".as_bytes();

/// Bytes in which UTF-16 has become UTF-8.
struct Decoded<R> {
    inner: R,
    encoding: Encoding,
    /// Text that is ready, and how much of it was given.
    ready: String,
    given: usize,
    /// The decoder has come to the end.
    is_over: bool,
}

enum Encoding {
    /// Nothing was read yet.
    Unknown,
    /// ASCII and its supersets, after the first bytes.
    Bytes {
        head: [u8; 2],
        left: usize,
    },
    Utf16(Box<Decoder>),
}

impl<R: Read> Decoded<R> {
    /// Tells the encoding by the first two bytes: a mark, or a character below 256 with a byte of zero.
    fn begin(&mut self) -> io::Result<()> {
        let mut head = [0; 2];
        let mut left = 0;
        while left < 2 {
            match self.inner.read(&mut head[left..]) {
                Ok(0) => break,
                Ok(count) => left += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        let utf16 = match head {
            [0xff, 0xfe] | [1..=255, 0] if left == 2 => UTF_16LE,
            [0xfe, 0xff] | [0, 1..=255] if left == 2 => UTF_16BE,
            _ => {
                head.copy_within(..left, 2 - left);
                self.encoding = Encoding::Bytes { head, left };
                return Ok(());
            }
        };
        let mut decoder = Box::new(utf16.new_decoder_with_bom_removal());
        self.ready.reserve(8);
        let _ = decoder.decode_to_string(&head, &mut self.ready, false);
        self.encoding = Encoding::Utf16(decoder);
        Ok(())
    }
}

impl<R: Read> Read for Decoded<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if let Encoding::Unknown = self.encoding {
            self.begin()?;
        }
        let decoder = match &mut self.encoding {
            Encoding::Bytes { left: 0, .. } | Encoding::Unknown => return self.inner.read(bytes),
            Encoding::Bytes { head, left } => {
                let count = (&head[2 - *left..]).read(bytes)?;
                *left -= count;
                return Ok(count);
            }
            Encoding::Utf16(decoder) => decoder,
        };
        while self.given == self.ready.len() && !self.is_over {
            self.ready.clear();
            self.given = 0;
            let mut raw = [0; DECODED];
            let count = self.inner.read(&mut raw)?;
            // What is no text becomes the replacement character, which is in no number.
            self.ready.reserve(decoder.max_utf8_buffer_length(count).unwrap_or(4 * DECODED));
            self.is_over = count == 0;
            let _ = decoder.decode_to_string(&raw[..count], &mut self.ready, self.is_over);
        }
        let count = (&self.ready.as_bytes()[self.given..]).read(bytes)?;
        self.given += count;
        Ok(count)
    }
}

/// The lines of a file that hold more than spaces.
pub(super) struct Lines<R> {
    reader: BufReader<Decoded<R>>,
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
        let decoded =
            Decoded { inner, encoding: Encoding::Unknown, ready: String::new(), given: 0, is_over: false };
        let reader = BufReader::with_capacity(buffer, decoded);
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
                return Err(self.fault("it is not text; this is no table of numbers"));
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

    /// A line that is not UTF-8 is Windows-1252, which has Latin-1 in it.
    fn decode_as_utf8(&mut self) {
        if self.number == 1 && self.line.starts_with(MARK) {
            self.line.drain(..MARK.len());
        }
        if !self.line.is_ascii() && str::from_utf8(&self.line).is_err() {
            self.line = WINDOWS_1252.decode_without_bom_handling(&self.line).0.into_owned().into_bytes();
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
