//! Lines of a table of numbers, as captures and taps have them.
//!
//! Cells are separated by commas, semicolons, tabs or spaces. Lines that begin with `#` and empty lines are
//! skipped.

use super::IoError;
use crate::messages::Quoted;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Bytes that tell whether a file is a table.
const LOOKED_AT: u64 = 4096;
/// Lines among them, headings too.
const LINES: usize = 3;
/// Longest line.
const LONGEST_LINE: u64 = 1 << 20;

/// Whether the file at `path` reads as a table: a line of numbers is among the first.
pub(super) fn is_table(path: &Path) -> bool {
    let Some(file) = path.is_file().then(|| File::open(path).ok()).flatten() else { return false };
    let mut table = Table::new(file.take(LOOKED_AT), "", "", LOOKED_AT as usize);
    let line = |_| table.cells().ok().filter(|cells| !cells.is_empty());
    (0..LINES).map_while(line).any(|cells| cells.iter().all(|cell| cell.parse::<f64>().is_ok()))
}

/// The lines that hold cells.
#[derive(Debug)]
pub struct Table<R> {
    reader: BufReader<R>,
    file: String,
    kind: &'static str,
    /// Number of the last line, from 1.
    pub line: u64,
    /// What stands between two cells; `None` for spaces. The first line decides.
    separator: Option<Option<char>>,
}

impl<R: Read> Table<R> {
    /// Of a file that is called `file` in messages, and should be of this kind. `buffer` bytes are read at a
    /// time.
    pub fn new(inner: R, file: &str, kind: &'static str, buffer: usize) -> Self {
        let reader = BufReader::with_capacity(buffer, inner);
        Self { reader, file: file.to_owned(), kind, line: 0, separator: None }
    }

    /// True if bytes have come that no line has used.
    pub fn is_more_at_hand(&self) -> bool {
        !self.reader.buffer().is_empty()
    }

    /// The cells of the next line; none at the end.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the line, or the system's refusal.
    pub fn cells(&mut self) -> Result<Vec<String>, IoError> {
        let Some(line) = self.next_line()? else { return Ok(Vec::new()) };
        let first = || [';', '\t', ','].into_iter().find(|&c| line.contains(c));
        let cell = |cell: &str| cell.trim().trim_matches('"').to_owned();
        Ok(match *self.separator.get_or_insert_with(first) {
            Some(separator) => line.split(separator).map(cell).collect(),
            None => line.split_whitespace().map(cell).collect(),
        })
    }

    fn next_line(&mut self) -> Result<Option<String>, IoError> {
        loop {
            let mut bytes = Vec::new();
            let read = (&mut self.reader).take(LONGEST_LINE + 1).read_until(b'\n', &mut bytes);
            self.line += 1;
            match read.map_err(IoError::system(&self.file, "read it"))? {
                0 => return Ok(None),
                length if length as u64 > LONGEST_LINE => {
                    return Err(
                        self.fault(&format!("longer than {LONGEST_LINE} bytes; write one line per frame"))
                    );
                }
                _ => {}
            }
            let text = String::from_utf8(bytes)
                .map_err(|_| self.fault("it is not UTF-8; this is no table of numbers"))?;
            let text = text.trim_start_matches('\u{feff}').trim();
            if !text.is_empty() && !text.starts_with('#') {
                return Ok(Some(text.to_owned()));
            }
        }
    }

    /// What is wrong with the last line.
    pub fn fault(&self, problem: &str) -> IoError {
        IoError::malformed(&self.file, self.kind)(format!("line {}: {problem}", self.line))
    }

    /// The numbers in the cells of the last line, as many as there are cells. An empty cell is a missing
    /// sample, NaN.
    ///
    /// # Errors
    /// [`IoError::Malformed`] with the line and the column.
    pub fn numbers(&self, cells: &[String]) -> Result<Vec<f64>, IoError> {
        let of_cell = |(column, cell): (usize, &String)| {
            number(cell).ok_or_else(|| {
                self.fault(&format!(
                    "column {}: \"{}\" is no number; decimals have a point, cells are separated by , ; tab or space",
                    column + 1,
                    Quoted(cell)
                ))
            })
        };
        cells.iter().enumerate().map(of_cell).collect()
    }
}

/// The number in a cell; an empty one is a missing sample.
pub fn number(cell: &str) -> Option<f64> {
    if cell.is_empty() { Some(f64::NAN) } else { cell.parse().ok() }
}
